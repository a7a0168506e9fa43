import { GaussianSplatError } from '@gaussian-splat/core';
import { asciiOf, grouped, startsWith, viewOf } from '../bytes.js';

/** Media type of an image file, and its size in pixels. */
export interface ImageHeader {
  readonly type: 'image/png' | 'image/jpeg' | 'image/webp' | 'image/avif' | 'image/ktx2';
  readonly width: number;
  readonly height: number;
}

/** Reads the header of a PNG, JPEG, WebP, AVIF or KTX2 image. Undefined for other files, and for headers without a size. */
export function imageHeader(bytes: Uint8Array): ImageHeader | undefined {
  const found = pngHeader(bytes) ?? jpegHeader(bytes) ?? webpHeader(bytes) ?? avifHeader(bytes) ?? ktx2Header(bytes);
  return found && found.width > 0 && found.height > 0 ? found : undefined;
}

/** Maximum number of pixels of an image outside a mesh: 16,384 x 8,192, which take 512 MB after decoding. */
const MAX_PIXELS = 2 ** 27;

/**
 * Reads the header of an image file before a browser decodes the file, which may be a thousandth of its pixels.
 * @param where Name of the image in error messages.
 * @returns The header; undefined if the file is none of the formats of {@link imageHeader}.
 * @throws GaussianSplatError `out-of-memory/budget` for more than {@link MAX_PIXELS}.
 */
export function boundedImageHeader(bytes: Uint8Array, where: string): ImageHeader | undefined {
  const header = imageHeader(bytes);
  if (header === undefined || header.width * header.height <= MAX_PIXELS) return header;
  throw new GaussianSplatError('out-of-memory/budget', {
    where,
    expected: `an image of at most ${grouped(MAX_PIXELS)} pixels`,
    found: `${header.width} x ${header.height}`,
    remedy: 'reduce the image',
  });
}

function pngHeader(bytes: Uint8Array): ImageHeader | undefined {
  if (
    !startsWith(
      bytes,
      '\x89PNG\r\n\x1a\n'.split('').map((c) => c.charCodeAt(0)),
    ) ||
    bytes.length < 24
  )
    return undefined;
  const view = viewOf(bytes);
  return { type: 'image/png', width: view.getUint32(16), height: view.getUint32(20) };
}

/** Whether a JPEG marker starts a frame: C0 to CF, except tables (C4), reserved (C8) and arithmetic conditioning (CC). */
const isFrame = (marker: number): boolean => marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker);

const KTX2 = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];

/**
 * Reads the header of a KTX2 file with one 2D image of Basis Universal (`VK_FORMAT_UNDEFINED`). Undefined for other KTX2
 * files, which KHR_texture_basisu does not allow.
 */
function ktx2Header(bytes: Uint8Array): ImageHeader | undefined {
  if (!startsWith(bytes, KTX2) || bytes.length < 80) return undefined;
  const view = viewOf(bytes);
  const at = (index: number): number => view.getUint32(12 + 4 * index, true);
  const [format, , width, height, depth, layers, faces] = [0, 1, 2, 3, 4, 5, 6].map(at);
  const isPlain = format === 0 && depth === 0 && layers <= 1 && faces === 1;
  return isPlain ? { type: 'image/ktx2', width, height } : undefined;
}

function jpegHeader(bytes: Uint8Array): ImageHeader | undefined {
  if (!startsWith(bytes, [0xff, 0xd8, 0xff])) return undefined;
  const view = viewOf(bytes);
  for (let at = 2; at + 9 <= bytes.length;) {
    if (bytes[at] !== 0xff) return undefined;
    const marker = bytes[at + 1];
    if (isFrame(marker)) return { type: 'image/jpeg', width: view.getUint16(at + 7), height: view.getUint16(at + 5) };
    // Fill bytes and some markers have no segment.
    if (marker === 0xff) at++;
    else if (marker === 0x01 || (marker >= 0xd0 && marker <= 0xd8)) at += 2;
    else at += 2 + Math.max(2, view.getUint16(at + 2));
  }
  return undefined;
}

/**
 * Reads the size of an AVIF image. A grid of tiles has several sizes; the largest is that of the image.
 * Undefined for sequences of images, whose size is elsewhere.
 */
function avifHeader(bytes: Uint8Array): ImageHeader | undefined {
  const [brands] = startsWith(bytes, 'ftyp', 4) ? boxesIn(bytes, 'ftyp') : [];
  if (!brands || startsWith(brands, 'avis') || !asciiOf(brands, 0, brands.length).includes('avif')) return undefined;
  const sizes = boxesIn(bytes, 'meta')
    .flatMap((meta) => boxesIn(meta.subarray(4), 'iprp'))
    .flatMap((properties) => boxesIn(properties, 'ipco'))
    .flatMap((properties) => boxesIn(properties, 'ispe'))
    .filter(({ length }) => length >= 12)
    .map(viewOf);
  const max = (at: number): number => sizes.reduce((largest, view) => Math.max(largest, view.getUint32(at)), 0);
  return { type: 'image/avif', width: max(4), height: max(8) };
}

/** Returns the contents of all boxes of a type in a list of boxes (ISO/IEC 14496-12), up to one that has no valid length. */
function boxesIn(bytes: Uint8Array, type: string): Uint8Array[] {
  const found: Uint8Array[] = [];
  const view = viewOf(bytes);
  for (let at = 0; at + 8 <= bytes.length;) {
    const end = at + view.getUint32(at);
    if (end < at + 8 || end > bytes.length) break;
    if (startsWith(bytes, type, at + 4)) found.push(bytes.subarray(at + 8, end));
    at = end;
  }
  return found;
}

function webpHeader(bytes: Uint8Array): ImageHeader | undefined {
  if (!startsWith(bytes, 'RIFF') || !startsWith(bytes, 'WEBP', 8) || bytes.length < 30) return undefined;
  const view = viewOf(bytes);
  const uint24 = (at: number): number => view.getUint16(at, true) | (bytes[at + 2] << 16);
  const type = 'image/webp';
  switch (asciiOf(bytes, 12, 16)) {
    case 'VP8X':
      return { type, width: 1 + uint24(24), height: 1 + uint24(27) };
    case 'VP8 ':
      return { type, width: view.getUint16(26, true) & 0x3fff, height: view.getUint16(28, true) & 0x3fff };
    case 'VP8L': {
      const size = view.getUint32(21, true);
      return { type, width: 1 + (size & 0x3fff), height: 1 + ((size >>> 14) & 0x3fff) };
    }
    default:
      return undefined;
  }
}
