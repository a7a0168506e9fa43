import {
  badStatus,
  changed,
  chunksOf,
  fetchPatiently,
  interrupted,
  label,
  unreachable,
} from '@gaussian-splat/core/fetch';
import { refuse } from './budget.js';
import { lengthOf, tagOf } from './headers.js';
import { grouped, GrowingBytes } from './bytes.js';
import type { FetchSceneOptions } from './fetch-scene.js';

/** Result of {@link fetchRange}. */
export interface FetchedRange {
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** Whether the server supports range requests. If false, it sent the file from its beginning. */
  readonly isPartial: boolean;
  /** Size of the whole file in bytes; undefined if the server does not send it, or it cannot be read. */
  readonly totalBytes?: number | undefined;
  /** Validator of the file's version: its ETag, else its date; undefined if the server sends none that can be read. */
  readonly tag?: string | undefined;
}

const RETRY_DELAY_MS = 250;

export interface FetchRangeOptions extends Pick<
  FetchSceneOptions,
  'credentials' | 'signal' | 'retries' | 'maxBytes' | 'maxSeconds'
> {
  /** Validator of the version that earlier ranges are from: see {@link FetchedRange.tag}. Others are refused. */
  readonly tag?: string | undefined;
}

/**
 * Downloads bytes `start` to `end`, excluding `end`, of a file by a range request. If the server sends the whole file,
 * the other bytes are discarded. Interrupted connections and temporarily unavailable servers are retried.
 * @param url Absolute URL.
 * @returns The bytes of the range; fewer if the file ends before `end`.
 * @throws GaussianSplatError `network/unreachable`, `network/status`, `network/interrupted`, `network/changed` for
 * another version of the file, `out-of-memory/budget`; the reason of `signal`.
 */
export async function fetchRange(
  url: string,
  start: number,
  end: number,
  { tag, ...options }: FetchRangeOptions = {},
): Promise<FetchedRange> {
  const range = await retried(new URL(url), start, end, options);
  if (tag === undefined || range.tag === undefined || range.tag === tag) return range;
  throw changed(new URL(url), tag, range.tag);
}

async function retried(
  address: URL,
  start: number,
  end: number,
  { credentials, retries = 3, signal, maxBytes = Infinity, maxSeconds = Infinity }: FetchRangeOptions,
): Promise<FetchedRange> {
  if (end - start > maxBytes) refuse(label(address), `at most ${grouped(maxBytes)} bytes`, grouped(end - start));
  // Timers are limited to 2^31 ms.
  const limit = maxSeconds < 2e6 ? AbortSignal.timeout(1000 * Math.max(0, maxSeconds)) : undefined;
  const signals = [signal, limit].filter((each) => each !== undefined);
  const either = signals.length > 0 ? AbortSignal.any(signals) : undefined;
  for (let tries = 0; ; tries++) {
    try {
      return await attempt(address, start, end, { credentials, signal: either });
    } catch (error) {
      signal?.throwIfAborted();
      if (limit?.aborted) refuse(label(address), `at most ${maxSeconds} s`, 'more', error);
      const { code, message } = error as { code?: string; message: string };
      const isPassing =
        code === 'network/interrupted' || code === 'network/unreachable' || /status (429|5\d\d)/.test(message);
      if (!isPassing || tries >= retries) throw error;
      await new Promise((resolve) => setTimeout(resolve, RETRY_DELAY_MS * 2 ** tries));
      signal?.throwIfAborted();
    }
  }
}

async function attempt(
  address: URL,
  start: number,
  end: number,
  { credentials = 'same-origin', signal }: Pick<FetchSceneOptions, 'credentials' | 'signal'>,
): Promise<FetchedRange> {
  const headers = { Range: `bytes=${start}-${end - 1}` };
  const response = await fetchPatiently(address, { mode: 'cors', credentials, signal: signal ?? null, headers }).catch(
    (cause: unknown) => {
      signal?.throwIfAborted();
      throw unreachable(address, cause);
    },
  );
  const isPartial = response.status === 206;
  if (!isPartial && response.status !== 200) {
    await response.body?.cancel().catch(() => undefined);
    throw badStatus(address, response);
  }
  const range = /^bytes (\d+)-(\d+)\/(\d+)?/.exec(response.headers.get('Content-Range') ?? '');
  const bytes = new GrowingBytes(end - start);
  const broken = (cause: unknown): unknown =>
    signal?.aborted ? signal.reason : interrupted(address, cause, bytes.length, end - start);
  if (isPartial && range && Number(range[1]) !== start) throw broken(new Error('other bytes than requested'));
  let at = isPartial ? start : 0;
  for await (const chunk of chunksOf(response, broken)) {
    const from = Math.max(0, start - at);
    if (from < chunk.length) bytes.append(chunk.subarray(from, Math.min(chunk.length, end - at)));
    at += chunk.length;
    if (at >= end) break;
  }
  // Cross-origin, scripts cannot read Content-Range, but Content-Length.
  const sent = range ? Number(range[2]) + 1 - start : isPartial ? (lengthOf(response) ?? 0) : 0;
  if (bytes.length < Math.min(sent, end - start)) throw broken(undefined);
  const totalBytes = range?.[3] === undefined ? undefined : Number(range[3]);
  return { bytes: bytes.view(), isPartial, tag: tagOf(response), totalBytes };
}
