/**
 * Measures the loss of frames with fewer pixels on the image itself, because neither splat sizes nor coverage predict
 * it.
 */

/** [height, width, 4] premultiplied, 0..1. */
export interface Pixels {
  readonly values: Float32Array;
  readonly width: number;
  readonly height: number;
}

/** Squared errors of the enlarged image, summed over the channels of the covered pixels. */
export interface LossSum {
  sum: number;
  values: number;
}

/** Pixels beside a block that the cubic kernel reaches, at scale 1. */
const REACH = 2;
/** Only every STEP-th pixel of a block is compared, across and down. */
const STEP = 2;

/**
 * Adds the loss of a block at a fraction of its pixels across and down: samples at the centers of larger pixels, as in
 * reduced frames, enlarged by the Catmull-Rom cubic (shaders/shared/compose.wgsl). Pixels at the edge, whose kernel
 * reaches outside, are skipped.
 * @param x of the block's first pixel within the image
 * @param y of the same pixel
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

/** PSNR with peak 1; Infinity without error or without covered pixels. */
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
  // The cubic overshoots beside an edge.
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

/** Adds the interpolated image between the centers of its pixels. */
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
