import { fetchPatiently, chunksOf } from '@gaussian-splat/core/fetch';
import { refuse } from './budget.js';
import { grouped, GrowingBytes } from './bytes.js';
import { badStatus, interrupted, label, unreachable } from './network-errors.js';
import type { FetchSceneOptions } from './fetch-scene.js';

/** A range of bytes of a file. */
export interface FetchedRange {
  readonly bytes: Uint8Array<ArrayBuffer>;
  /** False for servers that send whole files only. */
  readonly isPartial: boolean;
}

const RETRY_DELAY_MS = 250;

/**
 * Downloads bytes `start` to `end` of a file by a range request. If the server sends the whole file, the rest is
 * discarded. Interrupted connections, and temporarily unavailable servers, are retried.
 * @returns Fewer bytes if the file ends before.
 * @throws GaussianSplatError `network/unreachable`, `network/status`, `network/interrupted`, `out-of-memory/budget`;
 * the reason of `signal`.
 */
export async function fetchRange(
  url: string,
  start: number,
  end: number,
  options: Pick<FetchSceneOptions, 'credentials' | 'signal' | 'retries' | 'maxBytes'> = {},
): Promise<FetchedRange> {
  const { retries = 3, signal, maxBytes = Infinity } = options;
  const address = new URL(url);
  if (end - start > maxBytes) refuse(label(address), `at most ${grouped(maxBytes)} bytes`, grouped(end - start));
  for (let tries = 0; ; tries++) {
    try {
      return await attempt(address, start, end, options);
    } catch (error) {
      signal?.throwIfAborted();
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
  const range = /^bytes (\d+)-(\d+)\//.exec(response.headers.get('Content-Range') ?? '');
  const bytes = new GrowingBytes(end - start);
  const broken = (cause: unknown): unknown =>
    signal?.aborted ? signal.reason : interrupted(address, bytes.length, end - start, cause);
  if (isPartial && range && Number(range[1]) !== start) throw broken(new Error('other bytes than were asked for'));
  let at = isPartial ? start : 0;
  for await (const chunk of chunksOf(response, broken)) {
    const from = Math.max(0, start - at);
    if (from < chunk.length) bytes.append(chunk.subarray(from, Math.min(chunk.length, end - at)));
    at += chunk.length;
    if (at >= end) break;
  }
  const expected = range ? Number(range[2]) + 1 - start : 0;
  if (bytes.length < Math.min(expected, end - start)) throw broken(undefined);
  return { bytes: bytes.view(), isPartial };
}
