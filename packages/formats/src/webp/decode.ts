import { asciiOf, startsWith, viewOf } from '../bytes.js';
import { BitReader, cut, WebpError } from './bits.js';
import { readPixels } from './pixels.js';
import { readTransform, type Transform } from './transforms.js';

/** A decoded image; its size is in pixels. */
export interface WebpImage {
  readonly width: number;
  readonly height: number;
  /** [height, width] pixels, top row first. Bytes from the highest: alpha, red, green, blue; not premultiplied. */
  readonly pixels: Uint32Array;
}

const SIGNATURE = 0x2f;

/** Returns the size of a lossless image in pixels from its header. Throws {@link WebpError}. */
export function webpSize(file: Uint8Array): { width: number; height: number } {
  const bits = new BitReader(losslessStream(file).subarray(0, 5), () => undefined);
  return readHeader(bits);
}

/**
 * Decodes a lossless WebP image (RFC 9649) exactly, including the colors of transparent pixels, which a canvas does not
 * guarantee. The caller limits memory by {@link webpSize}.
 * @param take Called with a number of bytes before each allocation other than the pixels; may throw.
 * @throws WebpError
 */
export function decodeWebp(file: Uint8Array, take: (bytes: number) => void = () => undefined): WebpImage {
  const bits = new BitReader(losslessStream(file), take);
  const { width, height } = readHeader(bits);
  const transforms: Transform[] = [];
  let storedWidth = width;
  while (bits.read(1) === 1) {
    const transform = readTransform(bits, storedWidth, height);
    if (transforms.some(({ type }) => type === transform.type)) throw new WebpError('a transform that comes twice');
    transforms.push(transform);
    storedWidth = transform.storedWidth;
  }
  let pixels = readPixels(bits, storedWidth, height, true);
  for (const { undo } of transforms.reverse()) pixels = undo(pixels);
  return { width, height, pixels };
}

function readHeader(bits: BitReader): { width: number; height: number } {
  if (bits.read(8) !== SIGNATURE) throw new WebpError('a lossless image without its signature');
  const width = bits.read(14) + 1;
  const height = bits.read(14) + 1;
  bits.read(1);
  if (bits.read(3) !== 0) throw new WebpError('a version of lossless WebP that is not 0', 'foreign');
  return { width, height };
}

/** Returns the content of the chunk `VP8L` of a file. */
function losslessStream(file: Uint8Array): Uint8Array {
  if (file.length < 12) throw cut();
  if (!startsWith(file, 'RIFF') || !startsWith(file, 'WEBP', 8)) throw new WebpError('no WebP image', 'foreign');
  const view = viewOf(file);
  for (let at = 12; at + 8 <= file.length;) {
    const kind = asciiOf(file, at, at + 4);
    const size = view.getUint32(at + 4, true);
    if (kind === 'VP8L') {
      if (at + 8 + size > file.length) throw cut();
      return file.subarray(at + 8, at + 8 + size);
    }
    if (kind === 'VP8 ' || kind === 'ANIM') throw new WebpError('a lossy or animated WebP image', 'foreign');
    at += 8 + size + (size & 1);
  }
  throw cut();
}
