import { Gunzip, gunzipSync, Inflate, inflateSync } from 'fflate';
import { startsWith } from './bytes.js';

/** Number of compressed bytes that are inflated in one step. They may inflate to 17 MB before the stream is stopped. */
const STEP_BYTES = 16_384;

/**
 * Inflates raw deflate or gzip data, which stops soon after `max` bytes. The functions of fflate for whole files inflate
 * all data, even if their output buffer is shorter, so that the size of the result does not bound their time.
 * @throws Error for a damaged stream, or one of more than `max` bytes; RangeError if memory is insufficient.
 */
export function inflateUpTo(bytes: Uint8Array, max: number): Uint8Array<ArrayBuffer> {
  const isGzip = startsWith(bytes, [0x1f, 0x8b]);
  if (bytes.length <= STEP_BYTES) {
    // A stream would allocate buffers of 128 KiB for each of thousands of small parts.
    const whole = inflateAtOnce(bytes, isGzip, new Uint8Array(max + 1));
    if (whole.length > max) throw new Error(`more than ${max} bytes`);
    return whole;
  }
  const out = new Uint8Array(max);
  let length = 0;
  const put = (chunk: Uint8Array): void => {
    if (length + chunk.length > max) throw new Error(`more than ${max} bytes`);
    out.set(chunk, length);
    length += chunk.length;
  };
  const stream = isGzip ? new Gunzip(put) : new Inflate(put);
  for (let at = 0; at < bytes.length && length < max; at += STEP_BYTES)
    stream.push(bytes.subarray(at, at + STEP_BYTES), at + STEP_BYTES >= bytes.length);
  return out.subarray(0, length);
}

/** Inflates to a buffer. If that is too short, the result fills it, or an error is thrown. */
function inflateAtOnce(bytes: Uint8Array, isGzip: boolean, out: Uint8Array): Uint8Array<ArrayBuffer> {
  try {
    return (isGzip ? gunzipSync : inflateSync)(bytes, { out }) as Uint8Array<ArrayBuffer>;
  } catch (cause) {
    // fflate copies stored content without a check of the length.
    throw cause instanceof RangeError ? new Error(`more than ${out.length - 1} bytes`, { cause }) : cause;
  }
}
