import { type BitReader, WebpError } from './bits.js';
import { readPixels } from './pixels.js';
import { addPixels, predict } from './predictors.js';

/**
 * A transform that the encoder has applied to pixels. `undo` inverts it, and may modify its argument. `storedWidth` is the
 * width in pixels before the inversion.
 */
export interface Transform {
  readonly type: number;
  readonly storedWidth: number;
  readonly undo: (pixels: Uint32Array) => Uint32Array;
}

const [PREDICTOR, CROSS_COLOR, SUBTRACT_GREEN] = [0, 1, 2];

/** Reads a transform. @param width Width of the image in pixels after the inversion. */
export function readTransform(bits: BitReader, width: number, height: number): Transform {
  const type = bits.read(2);
  if (type === SUBTRACT_GREEN) return { type, storedWidth: width, undo: addGreen };
  if (type === PREDICTOR || type === CROSS_COLOR) {
    const blockBits = bits.read(3) + 2;
    const blocksAcross = Math.ceil(width / (1 << blockBits));
    const blocks = readPixels(bits, blocksAcross, Math.ceil(height / (1 << blockBits)), false);
    const undo = type === PREDICTOR ? predict : addCrossColor;
    return { type, storedWidth: width, undo: (pixels) => undo(pixels, width, blocks, blockBits, blocksAcross) };
  }
  return readPalette(bits, type, width, height);
}

function addGreen(pixels: Uint32Array): Uint32Array {
  for (let i = 0; i < pixels.length; i++) {
    const pixel = pixels[i];
    const green = (pixel >>> 8) & 255;
    pixels[i] = (pixel & 0xff00ff00) | (((pixel & 0x00ff00ff) + (green << 16) + green) & 0x00ff00ff);
  }
  return pixels;
}

/**
 * Inverts the color transform in place. Bytes 0, 1 and 2 of a block are the factors, in 1/32, of green for red, of green
 * for blue, and of red for blue.
 */
function addCrossColor(
  pixels: Uint32Array,
  width: number,
  blocks: Uint32Array,
  blockBits: number,
  blocksAcross: number,
): Uint32Array {
  const signed = (byte: number): number => (byte << 24) >> 24;
  for (let i = 0, x = 0, y = 0; i < pixels.length; i++) {
    const block = blocks[(y >> blockBits) * blocksAcross + (x >> blockBits)];
    const pixel = pixels[i];
    const green = signed((pixel >>> 8) & 255);
    const red = ((pixel >>> 16) + ((signed(block & 255) * green) >> 5)) & 255;
    const blueOfGreen = (signed((block >>> 8) & 255) * green) >> 5;
    const blueOfRed = (signed((block >>> 16) & 255) * signed(red)) >> 5;
    const blue = (pixel + blueOfGreen + blueOfRed) & 255;
    pixels[i] = (pixel & 0xff00ff00) | (red << 16) | blue;
    if (++x === width) {
      x = 0;
      y++;
    }
  }
  return pixels;
}

/** Reads a palette of up to 256 colors. With 16 colors or fewer, the green byte of a stored pixel has several indices. */
function readPalette(bits: BitReader, type: number, width: number, height: number): Transform {
  const size = bits.read(8) + 1;
  const differences = readPixels(bits, size, 1, false);
  const palette = new Uint32Array(256);
  for (let k = 0; k < size; k++) palette[k] = k === 0 ? differences[0] : addPixels(palette[k - 1], differences[k]);
  const shareBits = size > 16 ? 0 : size > 4 ? 1 : size > 2 ? 2 : 3;
  const storedWidth = Math.ceil(width / (1 << shareBits));
  const indexBits = 8 >> shareBits;
  const undo = (stored: Uint32Array): Uint32Array => {
    if (stored.length !== storedWidth * height) throw new WebpError('a palette image of another size');
    const pixels = new Uint32Array(width * height);
    for (let y = 0, at = 0; y < height; y++) {
      for (let x = 0; x < width; x++, at++) {
        const shared = (stored[y * storedWidth + (x >> shareBits)] >>> 8) & 255;
        pixels[at] = palette[(shared >>> ((x & ((1 << shareBits) - 1)) * indexBits)) & ((1 << indexBits) - 1)];
      }
    }
    return pixels;
  };
  return { type, storedWidth, undo };
}
