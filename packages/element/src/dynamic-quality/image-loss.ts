import { addLoss, decibelsOf, type LossSum, type Pixels } from './loss.js';

/** Sampled blocks of the image: maximum number across and down, and side in pixels. */
const [BLOCKS, SIDE] = [6, 32];
/** Cells across and down of the coverage grid. */
const CELLS = 64;

/** Position of a block in the image. */
interface Block extends Pixels {
  readonly x: number;
  readonly y: number;
}

/**
 * Loss of frames with fewer pixels, by the fraction of pixels across and down: dB over the covered pixels of blocks
 * spread over the image. The work is split into tasks of a few milliseconds.
 * @param canvas whose frame was drawn in the current task
 * @param drawn fulfills once the GPU has drawn it: reading its pixels earlier would block the page
 */
export async function lossesOf(
  canvas: HTMLCanvasElement,
  scales: readonly number[],
  drawn: Promise<unknown>,
): Promise<Map<number, number>> {
  const image = await createImageBitmap(canvas);
  await drawn;
  const blocks = blocksOf(image);
  const found = new Map<number, number>();
  for (const scale of scales) {
    const sum: LossSum = { sum: 0, values: 0 };
    for (const { x, y, ...pixels } of blocks) addLoss(pixels, scale, x, y, sum);
    found.set(scale, decibelsOf(sum));
    await new Promise((resolve) => setTimeout(resolve));
  }
  return found;
}

/**
 * Blocks spread over the covered area, closer together if it is small, so that it does not lie entirely in block edges,
 * which are not compared.
 */
function blocksOf(image: ImageBitmap): Block[] {
  const { x, y, width, height } = coveredOf(image);
  const [columns, rows] = [width, height].map((pixels) => Math.min(BLOCKS, Math.ceil((2 * pixels) / SIDE)));
  const context = contextOf(columns * SIDE, rows * SIDE);
  const placed = Array.from({ length: columns * rows }, (_, k) => {
    const [column, row] = [k % columns, Math.floor(k / columns)];
    const left = firstOf(x + ((column + 0.5) * width) / columns, image.width);
    const top = firstOf(y + ((row + 0.5) * height) / rows, image.height);
    context.drawImage(image, left, top, SIDE, SIDE, column * SIDE, row * SIDE, SIDE, SIDE);
    return { x: left, y: top, column, row };
  });
  const [across, down] = [Math.min(SIDE, image.width), Math.min(SIDE, image.height)];
  image.close();
  // Each call is a round trip to the GPU.
  const { data } = context.getImageData(0, 0, columns * SIDE, rows * SIDE);
  return placed.map(({ x, y, column, row }) => ({
    ...{ x, y, width: across, height: down },
    values: premultiplied(partOf(data, columns * SIDE, column * SIDE, row * SIDE, across, down)),
  }));
}

/** Copies a rectangle out of RGBA pixels; `ofWidth` is the width of the source. */
function partOf(
  data: Uint8ClampedArray,
  ofWidth: number,
  left: number,
  top: number,
  width: number,
  height: number,
): Uint8ClampedArray {
  const part = new Uint8ClampedArray(4 * width * height);
  for (let row = 0; row < height; row++) {
    const first = 4 * ((top + row) * ofWidth + left);
    part.set(data.subarray(first, first + 4 * width), 4 * row * width);
  }
  return part;
}

/** The first pixel of a block around a place. */
const firstOf = (middle: number, pixels: number): number =>
  Math.max(0, Math.min(pixels - SIDE, Math.round(middle - SIDE / 2)));

/** The covered rectangle at cell precision; the entire image if nothing is covered. */
function coveredOf(image: ImageBitmap): Pick<DOMRect, 'x' | 'y' | 'width' | 'height'> {
  const context = contextOf(CELLS, CELLS);
  context.drawImage(image, 0, 0, CELLS, CELLS);
  const { data } = context.getImageData(0, 0, CELLS, CELLS);
  const covered = Array.from({ length: CELLS * CELLS }, (_, i) => i).filter((i) => data[4 * i + 3] > 0);
  const [columns, rows] = [covered.map((i) => i % CELLS), covered.map((i) => Math.floor(i / CELLS))];
  const [x, width] = span(columns, image.width);
  const [y, height] = span(rows, image.height);
  return { x, y, width, height };
}

/** First pixel and number of pixels from the smallest cell to the largest. */
function span(cells: readonly number[], pixels: number): [number, number] {
  if (cells.length === 0) return [0, pixels];
  const [first, last] = [Math.min(...cells), Math.max(...cells)];
  return [(first * pixels) / CELLS, ((last - first + 1) * pixels) / CELLS];
}

function contextOf(width: number, height: number): OffscreenCanvasRenderingContext2D {
  const context = new OffscreenCanvas(width, height).getContext('2d');
  if (context === null) throw new Error('no 2D canvas');
  return context;
}

function premultiplied(data: Uint8ClampedArray): Float32Array {
  return Float32Array.from(data, (value, i) => (value / 255) * (i % 4 === 3 ? 1 : data[i | 3] / 255));
}
