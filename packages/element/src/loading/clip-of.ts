/** Reads clips by byte ranges. The worker loads this module for the first clip. */
import type { ClipPart, LoadLimits, PackedClipIndex } from '@gaussian-splat/formats';
import {
  CLIP_HEAD_BYTES,
  clipIndexBytes,
  fetchRange,
  fetchScene,
  packClipIndex,
  takeClipRoom,
  parseClip,
  readClipPart,
  type ClipPartContent,
  type FetchedRange,
} from '@gaussian-splat/formats';
import { GaussianSplatError, loadModule, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { FourDgsClip } from '@gaussian-splat/formats/4dgs';
import { packAnimation, type PackedAnimation } from '@gaussian-splat/renderer/tools';
import { fileLimits, fileName, limitsFrom, named } from './load-scene.js';
import type { FileRequest } from './protocol.js';

/** Size of the first request, bytes. It contains the index of most clips. */
const HEAD_BYTES = 8_192;

/** A clip whose index is to be read. */
export interface ClipRequest extends FileRequest {
  /** Content of the whole file, if the page already has it. */
  readonly whole?: Blob | undefined;
  /** Validator of the version of the file that the index is from: see `FetchedRange.tag`. */
  readonly tag?: string | undefined;
}

/** A part of a group of frames of a clip. */
export interface ClipPartRequest extends ClipRequest {
  readonly part: ClipPart;
  /** Index of the group that the part belongs to. */
  readonly group: number;
  readonly frames: number;
  readonly shDegree: ShDegree;
  readonly origin: Vector3;
}

/** A clip whose index has been parsed. */
export interface OpenedClip {
  readonly index: PackedClipIndex;
  /** Whether the server sends byte ranges; false if it sends only whole files. */
  readonly isPartial: boolean;
  /** Validator of the file's version, if the server sends one: see `FetchedRange.tag`. */
  readonly tag?: string | undefined;
  /** The whole file; absent for formats that are read by byte ranges. */
  readonly file?: Blob;
}

/**
 * Reads the head and the index of a clip. Throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or
 * the signal's reason if that is aborted.
 */
export async function openClip(request: ClipRequest, signal: AbortSignal): Promise<OpenedClip> {
  const name = fileName(request.url);
  const limits = limitsFrom(request);
  try {
    if (isFourDgs(request)) return await openFourDgs(request, signal);
    const { bytes, isPartial, tag, totalBytes } = await bytesAt(request, 0, HEAD_BYTES, signal, limits());
    const length = CLIP_HEAD_BYTES + clipIndexBytes(bytes, name);
    const whole =
      length <= bytes.length ? bytes : (await bytesAt({ ...request, tag }, 0, length, signal, limits())).bytes;
    const index = parseClip(whole, name, limits());
    if (totalBytes !== undefined && totalBytes < index.byteLength) throw tooShort(name, index.byteLength, totalBytes);
    takeClipRoom(index, name, limits());
    return { index: packClipIndex(index), isPartial, tag };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

/** Reads a part of a group of frames, and packs it into the layout of the GPU. Throws as {@link openClip} does. */
export async function readPart(request: ClipPartRequest, signal: AbortSignal): Promise<PackedAnimation> {
  const name = fileName(request.url);
  try {
    const { cloud, motion } = isFourDgs(request) ? await groupOfFourDgs(request) : await readGsvPart(request, signal);
    signal.throwIfAborted();
    return packAnimation(cloud, motion, request.origin);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

async function readGsvPart(request: ClipPartRequest, signal: AbortSignal): Promise<ClipPartContent> {
  const { part, frames, shDegree } = request;
  const limits = limitsFrom(request);
  const { bytes } = await bytesAt(request, part.start, endOf(part), signal, limits());
  return readClipPart({ bytes, part, frames, shDegree, name: fileName(request.url), limits: limits() });
}

/** Returns whether the extension of a file's name is `.4dgs`. */
const isFourDgs = ({ url }: ClipRequest): boolean => /\.4dgs$/i.test(fileName(url));

/**
 * The `.4dgs` file that was opened last. Its parsed content is kept, because each request computes one group of frames.
 */
let opened: { readonly url: string; readonly clip: FourDgsClip } | undefined;

async function openFourDgs(request: ClipRequest, signal: AbortSignal): Promise<OpenedClip> {
  const { url, credentials, whole } = request;
  const bytes = whole
    ? new Uint8Array(await whole.arrayBuffer())
    : await fetchScene(url, { mode: 'cors', credentials, signal, ...fileLimits(limitsFrom(request)()) });
  const clip = await fourDgsClip(request, bytes);
  takeClipRoom(clip.index, fileName(url), limitsFrom(request)());
  return {
    index: packClipIndex(clip.index),
    isPartial: true,
    file: whole ?? new Blob([bytes as Uint8Array<ArrayBuffer>]),
  };
}

async function fourDgsClip(request: ClipRequest, bytes: Uint8Array): Promise<FourDgsClip> {
  const { url } = request;
  const reading = await loadModule('the code that reads .4dgs files', () => import('@gaussian-splat/formats/4dgs'));
  const clip = await reading.FourDgsClip.open(bytes, fileName(url), limitsFrom(request)());
  opened = { url, clip };
  return clip;
}

async function groupOfFourDgs(request: ClipPartRequest): Promise<ClipPartContent> {
  const { url, whole, group } = request;
  const clip =
    opened?.url === url ? opened.clip : await fourDgsClip(request, new Uint8Array(await whole!.arrayBuffer()));
  return clip.group(group);
}

const tooShort = (where: string, expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('decode/truncated', {
    where,
    expected: `${expected} bytes, as its index says`,
    found: String(found),
    remedy: 'copy the file again; its end is missing',
  });

const endOf = ({ start, sceneBytes, motionBytes }: ClipPart): number => start + sceneBytes + motionBytes;

async function bytesAt(
  { url, credentials, whole, tag }: ClipRequest,
  start: number,
  end: number,
  signal: AbortSignal,
  { maxBytes, maxSeconds }: LoadLimits,
): Promise<FetchedRange> {
  if (whole) return { bytes: new Uint8Array(await whole.slice(start, end).arrayBuffer()), isPartial: true };
  return fetchRange(url, start, end, { credentials, signal, maxBytes, maxSeconds, tag });
}
