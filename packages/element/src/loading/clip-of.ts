/** Loaded by the worker when the first clip is shown. */
import type { ClipIndex, ClipPart } from '@gaussian-splat/formats';
import { CLIP_HEAD_BYTES, clipIndexBytes, fetchRange, parseClip, readClipPart } from '@gaussian-splat/formats';
import { packAnimation, type PackedAnimation } from '@gaussian-splat/renderer/tools';
import { fileName, limitsFrom, named } from './load-scene.js';
import type { ClipRequest } from './protocol.js';

/** Bytes that are asked for first: the index of most clips, and what follows it. */
const HEAD_BYTES = 8_192;

/** What the beginning of a clip says. */
export interface OpenedClip {
  readonly index: ClipIndex;
  /** False of servers that send whole files only. */
  readonly isPartial: boolean;
}

/** What a request asks for: the index, or a part. */
export const readClip = (request: ClipRequest, signal: AbortSignal): Promise<OpenedClip | PackedAnimation> =>
  (request.part ? readPart : openClip)(request, signal);

/** Head and index. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's reason once that is aborted. */
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

/** A part of a group, as the GPU reads it. Throws as {@link openClip} does. */
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
