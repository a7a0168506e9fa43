/** Loaded by the worker for the first clip. */
import type { ClipIndex, ClipPart } from '@gaussian-splat/formats';
import {
  CLIP_HEAD_BYTES,
  clipIndexBytes,
  fetchRange,
  fetchScene,
  parseClip,
  readClipPart,
  type ClipPartContent,
} from '@gaussian-splat/formats';
import { loadModule } from '@gaussian-splat/core';
import type { FourDgsClip } from '@gaussian-splat/formats/4dgs';
import { packAnimation, type PackedAnimation } from '@gaussian-splat/renderer/tools';
import { fileLimits, fileName, limitsFrom, named } from './load-scene.js';
import type { ClipRequest } from './protocol.js';

/** Size of the first request: the index of most clips, and some content. */
const HEAD_BYTES = 8_192;

/** The parsed beginning of a clip. */
export interface OpenedClip {
  readonly index: ClipIndex;
  /** False for servers that send whole files only. */
  readonly isPartial: boolean;
  /** The whole file, of formats that are not read by byte ranges. */
  readonly file?: Blob;
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
    if (isFourDgs(request)) return await openFourDgs(request, signal);
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
  const { origin } = request.part!;
  const name = fileName(request.url);
  try {
    const { cloud, motion } = isFourDgs(request) ? await groupOfFourDgs(request) : await readGsvPart(request, signal);
    signal.throwIfAborted();
    return packAnimation(cloud, motion, origin);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

async function readGsvPart(request: ClipRequest, signal: AbortSignal): Promise<ClipPartContent> {
  const { part, frames } = request.part!;
  const { bytes } = await bytesAt(request, part.start, endOf(part), signal);
  return readClipPart({ bytes, part, frames, name: fileName(request.url), limits: limitsFrom(request)() });
}

/** Recognized by the extension of its name, same as clips. */
const isFourDgs = ({ url }: ClipRequest): boolean => /\.4dgs$/i.test(fileName(url));

/** The file that was opened last: its groups are made one by one. */
let opened: { readonly url: string; readonly clip: FourDgsClip } | undefined;

async function openFourDgs(request: ClipRequest, signal: AbortSignal): Promise<OpenedClip> {
  const { url, credentials, whole } = request;
  const bytes = whole
    ? new Uint8Array(await whole.arrayBuffer())
    : await fetchScene(url, { mode: 'cors', credentials, signal, ...fileLimits(limitsFrom(request)()) });
  const clip = await fourDgsClip(request, bytes);
  return { index: clip.index, isPartial: true, file: whole ?? new Blob([bytes as Uint8Array<ArrayBuffer>]) };
}

async function fourDgsClip(request: ClipRequest, bytes: Uint8Array): Promise<FourDgsClip> {
  const { url } = request;
  const reading = await loadModule('the code that reads .4dgs files', () => import('@gaussian-splat/formats/4dgs'));
  const clip = await reading.FourDgsClip.open(bytes, fileName(url), limitsFrom(request)());
  opened = { url, clip };
  return clip;
}

async function groupOfFourDgs(request: ClipRequest): Promise<ClipPartContent> {
  const { url, whole, part } = request;
  const clip =
    opened?.url === url ? opened.clip : await fourDgsClip(request, new Uint8Array(await whole!.arrayBuffer()));
  return clip.group(part!.group);
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
