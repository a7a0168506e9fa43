import {
  GaussianSplatError,
  type ErrorCode,
  type ShDegree,
  type SplatFilter,
  type Vector3,
} from '@gaussian-splat/core';
import { ARRAYS, checkUpdate, numbersOf, type ArrayName, type SplatUpdate } from './splat-update.js';

/** "GSUP" in little-endian order. */
const MAGIC = 0x50555347;
const VERSION = 1;
const HEADER_BYTES = 48;
const [IS_RANGE, IS_RAW, ANTIALIASED, MIP] = [1, 2, 4, 8];
/** Default maximum of the bytes of one update. */
const MAX_BYTES = 2 ** 31;

/** Options of {@link updatesIn}. */
export interface UpdateOptions {
  /** Maximum number of bytes of one update. Default 2 GiB. */
  readonly maxBytes?: number | undefined;
  /** Ends the loop and cancels the stream when it is aborted. */
  readonly signal?: AbortSignal | undefined;
}

/**
 * Returns the message of an update: its header of 48 bytes, and its arrays. docs/guide/changing-scenes.md has the layout.
 * @throws GaussianSplatError `argument/cloud`, as {@link checkUpdate}; `argument/value` for a `first` or a `step` that
 * is no integer of 32 bits.
 */
export function encodeUpdate(update: SplatUpdate): ArrayBuffer {
  const { count, shDegree } = checkUpdate(update);
  const { first, step = 0, raw, filter, origin = [0, 0, 0] } = update;
  requireWord('first', first ?? 0);
  requireWord('step', step);
  const names = ARRAYS.filter((name) => update[name] !== undefined);
  const message = new ArrayBuffer(HEADER_BYTES + bodyBytes(names, count, shDegree));
  const view = new DataView(message);
  view.setUint32(0, MAGIC, true);
  view.setUint8(4, VERSION);
  const filterFlag = filter === 'mip' ? MIP : filter === 'antialiased' ? ANTIALIASED : 0;
  view.setUint8(5, (first === undefined ? 0 : IS_RANGE) | (raw ? IS_RAW : 0) | filterFlag);
  view.setUint8(
    6,
    names.reduce((bits, name) => bits | (1 << ARRAYS.indexOf(name)), 0),
  );
  view.setUint8(7, shDegree);
  [step, first ?? 0, count].forEach((word, k) => view.setUint32(8 + 4 * k, word, true));
  origin.forEach((x, axis) => view.setFloat64(24 + 8 * axis, x, true));
  let at = HEADER_BYTES;
  for (const name of names) {
    new Float32Array(message, at).set(update[name]!);
    at += update[name]!.byteLength;
  }
  return message;
}

/**
 * Reads one message. The arrays of the result are views of its bytes, or copies if these are not aligned to 4 bytes.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported`, or `decode/truncated` for another length than that
 * of the header.
 */
export function decodeUpdate(message: ArrayBuffer | Uint8Array<ArrayBuffer>): SplatUpdate {
  const given = message instanceof ArrayBuffer ? new Uint8Array(message) : message;
  const header = readHeader(given);
  if (given.byteLength !== header.byteLength)
    throw damaged('decode/truncated', `${header.byteLength} bytes`, `${given.byteLength} bytes`);
  const bytes = given.byteOffset % 4 === 0 ? given : given.slice();
  const arrays: Partial<Record<ArrayName, Float32Array>> = {};
  let at = bytes.byteOffset + HEADER_BYTES;
  for (const name of header.names) {
    const length = numbersOf(name, header.shDegree) * header.count;
    arrays[name] = new Float32Array(bytes.buffer, at, length);
    at += 4 * length;
  }
  return { ...header.update, ...arrays };
}

/**
 * Yields the updates of a stream of bytes: messages in sequence, in parts of any lengths. Leaving the loop cancels the
 * stream.
 * @throws GaussianSplatError as {@link decodeUpdate}; `out-of-memory/budget` for a message above the limit, before any
 * memory is allocated for it; `decode/truncated` if the stream ends within a message; or the error of the stream.
 */
export async function* updatesIn(
  stream: ReadableStream<Uint8Array>,
  { maxBytes = MAX_BYTES, signal }: UpdateOptions = {},
): AsyncGenerator<SplatUpdate, void> {
  const reader = stream.getReader();
  const parts = new Parts(maxBytes);
  const cancel = (): Promise<void> => reader.cancel().catch(() => undefined);
  signal?.addEventListener('abort', cancel, { once: true });
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (signal?.aborted) return;
      if (done) return parts.end();
      yield* parts.add(value);
    }
  } finally {
    signal?.removeEventListener('abort', cancel);
    // Has no effect on a stream that has ended.
    await cancel();
    reader.releaseLock();
  }
}

/** Joins the parts of a stream to messages. */
class Parts {
  readonly #maxBytes: number;
  #message = new Uint8Array(HEADER_BYTES);
  #filled = 0;

  constructor(maxBytes: number) {
    this.#maxBytes = maxBytes;
  }

  *add(bytes: Uint8Array): Generator<SplatUpdate, void> {
    for (let at = 0; at < bytes.length;) {
      const part = bytes.subarray(at, at + this.#message.length - this.#filled);
      this.#message.set(part, this.#filled);
      this.#filled += part.length;
      at += part.length;
      if (this.#filled === HEADER_BYTES) this.#grow();
      if (this.#filled < this.#message.length) continue;
      const update = decodeUpdate(this.#message);
      [this.#message, this.#filled] = [new Uint8Array(HEADER_BYTES), 0];
      yield update;
    }
  }

  end(): void {
    if (this.#filled > 0)
      throw damaged('decode/truncated', `${this.#message.length} bytes`, `the end of the stream after ${this.#filled}`);
  }

  /** Allocates the message whose header has arrived. */
  #grow(): void {
    const { byteLength } = readHeader(this.#message);
    if (byteLength > this.#maxBytes) throw tooLarge(`at most ${this.#maxBytes} bytes`, `${byteLength} bytes`);
    if (byteLength === HEADER_BYTES) return;
    const header = this.#message;
    try {
      this.#message = new Uint8Array(byteLength);
    } catch (error) {
      throw tooLarge('enough memory for the message', (error as Error).message);
    }
    this.#message.set(header);
  }
}

interface Header {
  readonly names: readonly ArrayName[];
  readonly count: number;
  readonly shDegree: ShDegree;
  /** Length of the whole message. */
  readonly byteLength: number;
  /** The update without its arrays. */
  readonly update: SplatUpdate;
}

function readHeader(bytes: Uint8Array): Header {
  if (bytes.length < HEADER_BYTES)
    throw damaged('decode/truncated', `a header of ${HEADER_BYTES} bytes`, `${bytes.length} bytes`);
  const view = new DataView(bytes.buffer, bytes.byteOffset, HEADER_BYTES);
  const word = (at: number): number => view.getUint32(at, true);
  if (word(0) !== MAGIC) throw damaged('decode/header', '"GSUP" in bytes 0 to 3', `0x${word(0).toString(16)}`);
  const [version, flags, bits, degree] = bytes.subarray(4, 8);
  if (version !== VERSION) throw damaged('decode/unsupported', `version ${VERSION}`, `version ${version}`);
  if (flags > 15 || flags >> 2 === 3) throw damaged('decode/header', 'known flags in byte 5', `0b${flags.toString(2)}`);
  const isRange = (flags & IS_RANGE) !== 0;
  const names = ARRAYS.filter((_, k) => bits & (1 << k));
  const hasAll = (bits & 15) === 15 && bits >> 4 !== 0;
  if (bits > 47 || bits === 0 || !(isRange || hasAll) || (!(bits & 16) && degree > 0))
    throw damaged('decode/header', 'arrays of a scene in byte 6', `0b${bits.toString(2)}`);
  if (degree > 3) throw damaged('decode/header', 'a degree of 0 to 3 in byte 7', `${degree}`);
  const [step, first, count] = [word(8), word(12), word(16)];
  if (word(20) !== 0) throw damaged('decode/header', '0 in bytes 20 to 23', `${word(20)}`);
  const shDegree = degree as ShDegree;
  const origin = [0, 1, 2].map((axis) => view.getFloat64(24 + 8 * axis, true)) as unknown as Vector3;
  if (!origin.every(Number.isFinite)) throw damaged('decode/header', 'a finite origin', origin.join(' '));
  const filter: SplatFilter = flags & MIP ? 'mip' : flags & ANTIALIASED ? 'antialiased' : 'classic';
  const update = { first: isRange ? first : undefined, step, raw: (flags & IS_RAW) !== 0, origin, filter, shDegree };
  return { names, count, shDegree, byteLength: HEADER_BYTES + bodyBytes(names, count, shDegree), update };
}

const bodyBytes = (names: readonly ArrayName[], count: number, shDegree: ShDegree): number =>
  names.reduce((sum, name) => sum + 4 * count * numbersOf(name, shDegree), 0);

function requireWord(name: string, value: number): void {
  if (Number.isInteger(value) && value >= 0 && value < 2 ** 32) return;
  throw new GaussianSplatError('argument/value', {
    where: `SplatUpdate.${name}`,
    expected: 'an integer from 0 to 4294967295',
    found: String(value),
    remedy: 'pass a number that fits the header of the message',
  });
}

const damaged = (code: ErrorCode, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError(code, {
    where: 'update of splats',
    expected,
    found,
    remedy: 'write messages as docs/guide/changing-scenes.md describes, or with encodeUpdate',
  });

const tooLarge = (expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where: 'update of splats',
    expected,
    found,
    remedy: 'send fewer splats or a lower degree of harmonics, or raise the limit',
  });
