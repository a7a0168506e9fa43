type Predictor = (left: number, top: number, topRight: number, topLeft: number) => number;

const BLACK = 0xff000000;

/** The 14 predictors of a pixel from its neighbors (RFC 9649, 4.1). The codes 14 and 15 are black. */
const PREDICTORS: readonly Predictor[] = [
  () => BLACK,
  (left) => left,
  (_, top) => top,
  (_, __, topRight) => topRight,
  (_, __, ___, topLeft) => topLeft,
  (left, top, topRight) => average(average(left, topRight), top),
  (left, _, __, topLeft) => average(left, topLeft),
  (left, top) => average(left, top),
  (_, top, __, topLeft) => average(topLeft, top),
  (_, top, topRight) => average(top, topRight),
  (left, top, topRight, topLeft) => average(average(left, topLeft), average(top, topRight)),
  (left, top, _, topLeft) => select(left, top, topLeft),
  (left, top, _, topLeft) => perByte((a, b, c) => a + b - c, left, top, topLeft),
  (left, top, _, topLeft) => {
    const mean = average(left, top);
    return perByte((a, c) => a + (((a - c) / 2) | 0), mean, topLeft, 0);
  },
  () => BLACK,
  () => BLACK,
];

/**
 * Inverts prediction in place, and returns `pixels`, which contains differences from predicted pixels.
 * @param blocks Pixels whose green is the predictor of each block of 2^blockBits by 2^blockBits pixels.
 * @param blocksAcross Number of blocks in a row.
 */
export function predict(
  pixels: Uint32Array,
  width: number,
  blocks: Uint32Array,
  blockBits: number,
  blocksAcross: number,
): Uint32Array {
  pixels[0] = addPixels(pixels[0], BLACK);
  for (let x = 1; x < width; x++) pixels[x] = addPixels(pixels[x], pixels[x - 1]);
  for (let row = width, y = 1; row < pixels.length; row += width, y++) {
    pixels[row] = addPixels(pixels[row], pixels[row - width]);
    const blockRow = (y >> blockBits) * blocksAcross;
    for (let x = 1; x < width;) {
      const block = x >> blockBits;
      const predictor = PREDICTORS[(blocks[blockRow + block] >>> 8) & 15];
      const end = Math.min(width, (block + 1) << blockBits);
      for (; x < end; x++) {
        const at = row + x;
        const above = at - width;
        // For the last column, the pixel at the top right is the first pixel of the current row, as RFC 9649 specifies.
        const foretold = predictor(pixels[at - 1], pixels[above], pixels[above + 1], pixels[above - 1]);
        pixels[at] = addPixels(pixels[at], foretold);
      }
    }
  }
  return pixels;
}

/** Adds each of the four bytes of two pixels, modulo 256. */
export function addPixels(a: number, b: number): number {
  return (
    ((((a & 0xff00ff00) >>> 0) + ((b & 0xff00ff00) >>> 0)) & 0xff00ff00) |
    (((a & 0x00ff00ff) + (b & 0x00ff00ff)) & 0x00ff00ff)
  );
}

/** Returns the mean of each byte of two pixels, rounded down. */
function average(a: number, b: number): number {
  return (((a ^ b) & 0xfefefefe) >>> 1) + (a & b);
}

/** Returns `left` or `top`: the one whose bytes are nearer to left + top - topLeft. */
function select(left: number, top: number, topLeft: number): number {
  let toLeft = 0;
  let toTop = 0;
  for (let shift = 0; shift < 32; shift += 8) {
    const corner = (topLeft >>> shift) & 255;
    toLeft += Math.abs(((top >>> shift) & 255) - corner);
    toTop += Math.abs(((left >>> shift) & 255) - corner);
  }
  return toLeft < toTop ? left : top;
}

function perByte(f: (a: number, b: number, c: number) => number, a: number, b: number, c: number): number {
  let result = 0;
  for (let shift = 0; shift < 32; shift += 8) {
    const value = f((a >>> shift) & 255, (b >>> shift) & 255, (c >>> shift) & 255);
    result |= (value < 0 ? 0 : value > 255 ? 255 : value) << shift;
  }
  return result;
}
