/**
 * Measures the loss of frames with fewer pixels, from the image itself, because neither the sizes of splats nor their
 * coverage predict the loss.
 */

/** Pixels of an image; `values` are [height, width, 4], premultiplied, 0..1. */
export interface Pixels {
  readonly values: Float32Array;
  readonly width: number;
  readonly height: number;
}

/**
 * Squared errors of an enlarged image, summed over the channels of covered pixels, and the number of the summed values.
 */
export interface LossSum {
  sum: number;
  values: number;
}

/** Distance in pixels that the cubic kernel reaches, at scale 1. */
const REACH = 2;
/** Distance in pixels of the compared pixels of a block, across and down. */
const STEP = 2;

/**
 * Adds the loss of a block at a scale. The block is sampled at the centers of larger pixels, as in reduced frames, and
 * enlarged by the Catmull-Rom cubic (shaders/shared/compose.wgsl). Pixels near the edge, whose kernel reaches outside,
 * are skipped.
 * @param scale Fraction of the width and the height of reduced frames.
 * @param x Column of the block's first pixel in the image.
 * @param y Row of the block's first pixel in the image.
 * @param to Sum to which the errors are added.
 */
export function addLoss({ values, width, height }: Pixels, scale: number, x: number, y: number, to: LossSum): void {
  const margin = Math.ceil(REACH / scale);
  const found = new Float64Array(4);
  for (let row = margin; row < height - margin; row += STEP) {
    for (let column = margin; column < width - margin; column += STEP) {
      enlargedAt(values, width, height, scale, [column, row, x, y], found);
      const at = 4 * (row * width + column);
      if (values[at + 3] <= 0 && found[3] <= 0) continue;
      for (let k = 0; k < 4; k++) to.sum += (found[k] - values[at + k]) ** 2;
      to.values += 4;
    }
  }
}

/** Returns the PSNR for a peak of 1, in dB; Infinity if there is no error, or no covered pixel. */
export const decibelsOf = ({ sum, values }: LossSum): number => (sum > 0 ? -10 * Math.log10(sum / values) : Infinity);

function enlargedAt(
  values: Float32Array,
  width: number,
  height: number,
  scale: number,
  [column, row, x, y]: readonly [number, number, number, number],
  found: Float64Array,
): void {
  const [acrossAt, downAt] = [(x + column + 0.5) * scale - 0.5, (y + row + 0.5) * scale - 0.5];
  const [firstX, firstY] = [Math.floor(acrossAt) - 1, Math.floor(downAt) - 1];
  const [across, down] = [cubicWeights(acrossAt - firstX - 1), cubicWeights(downAt - firstY - 1)];
  found.fill(0);
  for (let j = 0; j < 4; j++) {
    const sampleY = (firstY + j + 0.5) / scale - 0.5 - y;
    for (let i = 0; i < 4; i++) {
      const sampleX = (firstX + i + 0.5) / scale - 0.5 - x;
      addSample(values, width, height, sampleX, sampleY, across[i] * down[j], found);
    }
  }
  // The cubic overshoots beside edges.
  for (let k = 0; k < 4; k++) found[k] = Math.max(0, found[k]);
  found[3] = Math.min(1, found[3]);
}

function cubicWeights(t: number): [number, number, number, number] {
  return [
    ((-0.5 * t + 1) * t - 0.5) * t,
    (1.5 * t - 2.5) * t * t + 1,
    ((-1.5 * t + 2) * t + 0.5) * t,
    (0.5 * t - 0.5) * t * t,
  ];
}

/**
 * Adds to the four channels of `found` `weight` times the bilinear interpolation of the image at a position in pixels.
 * The centers of pixels are integers. Positions outside are clamped to the edge.
 */
function addSample(
  values: Float32Array,
  width: number,
  height: number,
  x: number,
  y: number,
  weight: number,
  found: Float64Array,
): void {
  const [left, top] = [Math.floor(x), Math.floor(y)];
  const [shareX, shareY] = [x - left, y - top];
  for (let j = 0; j < 2; j++) {
    for (let i = 0; i < 2; i++) {
      const share = weight * (i === 1 ? shareX : 1 - shareX) * (j === 1 ? shareY : 1 - shareY);
      if (share === 0) continue;
      const at = 4 * (clamp(top + j, height) * width + clamp(left + i, width));
      for (let k = 0; k < 4; k++) found[k] += share * values[at + k];
    }
  }
}

const clamp = (place: number, count: number): number => Math.max(0, Math.min(count - 1, place));
