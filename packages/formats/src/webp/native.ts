import { decodeWebp, type WebpImage } from './decode.js';

/**
 * Lossless images of 6 x 6 pixels in base64, with alpha 0 to 255 and without alpha. A decoder that premultiplies or
 * converts colors changes some of their pixels.
 */
const PROBES = [
  'UklGRq4AAABXRUJQVlA4TKEAAAAvBUABEE2UIaL/sYiI/gfYtLbdhoALCG+Ng2lYnixdBB49BkzAJFumKHtHUIEwimQrzhEkIAEHIAEJLQEdCMlt0xABkRAXuwJGtW2DamAkhQrmOlhmguihwY4ggiWBCCL89UcG0rZJle3Krj3y3Ip/qD/TxF6uTv3nMWrx0wAoxwDCb0oPfeKKABhh8wX0kYEVF7q6GSSAG2zV0pYC8AMEAAA=',
  'UklGRqAAAABXRUJQVlA4TJMAAAAvBUABAE2UIaL/sYiI/gfYtLbdhoALCG+Ng2lYnixdBB49BkzAJFumKHtHUIEwimQrzhEkIAEHIAEJLQEdCMlt0xABkRAXuwJGtW2DamAkhQrmOlhmguihwY4ggiWBCCL89UcReW7xD/2ZxF7q1OcxWvwaQDkDhH9Kjz65IsCIzRf0kWHloqvbkIAbtrq0VYAfCAAA',
];
/**
 * `VP8L`, the type at byte 12 of the first chunk of a file with only pixels. Other chunks may specify color spaces or
 * rotations that a browser applies.
 */
const PLAIN = [0x56, 0x50, 0x38, 0x4c];
/** Minimum file size in bytes for the decoder of the browser. For smaller files, {@link decodeWebp} is faster. */
const MIN_BYTES = 4096;

let isExact: Promise<boolean> | undefined;

/**
 * Decodes a lossless WebP image by the `ImageDecoder` of the browser, if one exists and is exact. The first call tests
 * exactness.
 * @param size Expected size of the image in pixels.
 * @returns Undefined if the caller must use {@link decodeWebp}, which also reports faults of a file.
 */
export async function decodeNatively(
  file: Uint8Array,
  size: Pick<WebpImage, 'width' | 'height'>,
): Promise<WebpImage | undefined> {
  if (file.length < MIN_BYTES || PLAIN.some((byte, k) => file[12 + k] !== byte)) return undefined;
  if (typeof ImageDecoder !== 'function') return undefined;
  if (!(await (isExact ??= findExact()))) return undefined;
  const image = await decode(file).catch(() => undefined);
  return image?.width === size.width && image.height === size.height ? image : undefined;
}

async function findExact(): Promise<boolean> {
  try {
    for (const probe of PROBES) {
      const file = Uint8Array.from(atob(probe), (character) => character.charCodeAt(0));
      const { pixels } = await decode(file);
      const expected = decodeWebp(file).pixels;
      if (pixels.length !== expected.length || !pixels.every((pixel, i) => pixel === expected[i])) return false;
    }
    return true;
  } catch {
    return false;
  }
}

async function decode(file: Uint8Array): Promise<WebpImage> {
  const decoder = new ImageDecoder({
    data: file as Uint8Array<ArrayBuffer>,
    type: 'image/webp',
    colorSpaceConversion: 'none',
  });
  try {
    const { image } = await decoder.decode();
    try {
      return await pixelsOf(image);
    } finally {
      image.close();
    }
  } finally {
    decoder.close();
  }
}

async function pixelsOf(image: VideoFrame): Promise<WebpImage> {
  const { codedWidth: width, codedHeight: height, format } = image;
  // Shifts in bits of the first and the third byte of a pixel in ARGB.
  const [first, third] = format?.startsWith('RGB') ? [16, 0] : [0, 16];
  if (!/^(RGB|BGR)[AX]$/.test(format ?? '')) throw new Error(`pixels of format ${format}`);
  const pixels = new Uint32Array(width * height);
  const [{ offset, stride }] = await image.copyTo(pixels, { layout: [{ offset: 0, stride: 4 * width }] });
  if (offset !== 0 || stride !== 4 * width) throw new Error('pixels that lie elsewhere');
  const opaque = format!.endsWith('X') ? 0xff000000 : 0;
  if (opaque === 0 && third === 16) return { width, height, pixels };
  for (let i = 0; i < pixels.length; i++) {
    const pixel = pixels[i];
    pixels[i] = ((pixel & 0xff00ff00) | opaque | ((pixel & 255) << first) | (((pixel >>> 16) & 255) << third)) >>> 0;
  }
  return { width, height, pixels };
}
