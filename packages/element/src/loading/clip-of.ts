/** Loaded by the worker for the first clip. */
import type { ClipIndex, ClipPart } from '@gaussian-splat/formats';
import { CLIP_HEAD_BYTES, clipIndexBytes, fetchRange, parseClip, readClipPart } from '@gaussian-splat/formats';
import { packAnimation, type PackedAnimation } from '@gaussian-splat/renderer/tools';
import { fileName, limitsFrom, named } from './load-scene.js';
import type { ClipRequest } from './protocol.js';

/** Size of the first request: the index of most clips, and some content. */
const HEAD_BYTES = 8_192;

/** The parsed beginning of a clip. */
export interface OpenedClip {
  readonly index: ClipIndex;
  /** False for servers that send whole files only. */
  readonly isPartial: boolean;
}

/** Reads the requested data: the index, or a part. */
export const readClip = (request: ClipRequest, signal: AbortSignal): Promise<OpenedClip | PackedAnimation> =>
  (request.part ? readPart : openClip)(request, signal);

/**
 * Reads head and index. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's reason
 * once that is aborted.
 */
async function openClip(request: ClipRequest, signal: AbortSignal): Promise<OpenedClip> {
  const name = fileName(request.url);
  const limits = limitsFrom(request);
  try {
    const { bytes, isPartial } = await bytesAt(request, 0, HEAD_BYTES, signal);
    const length = CLIP_HEAD_BYTES + clipIndexBytes(bytes, name);
    const whole = length <= bytes.length ? bytes : (await bytesAt(request, 0, length, signal)).bytes;
    return { index: parseClip(whole, name, limits()), isPartial };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

/** Reads a part of a group in the layout of the GPU. Throws as {@link openClip} does. */
async function readPart(request: ClipRequest, signal: AbortSignal): Promise<PackedAnimation> {
  const { part, frames, origin } = request.part!;
  const name = fileName(request.url);
  const limits = limitsFrom(request);
  try {
    const { bytes } = await bytesAt(request, part.start, endOf(part), signal);
    const { cloud, motion } = await readClipPart({ bytes, part, frames, name, limits: limits() });
    signal.throwIfAborted();
    return packAnimation(cloud, motion, origin);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

const endOf = ({ start, sceneBytes, motionBytes }: ClipPart): number => start + sceneBytes + motionBytes;

async function bytesAt(
  { url, credentials, whole, limits }: ClipRequest,
  start: number,
  end: number,
  signal: AbortSignal,
): Promise<{ bytes: Uint8Array; isPartial: boolean }> {
  if (whole) return { bytes: new Uint8Array(await whole.slice(start, end).arrayBuffer()), isPartial: true };
  return fetchRange(url, start, end, { credentials, signal, maxBytes: limits?.maxBytes });
}
