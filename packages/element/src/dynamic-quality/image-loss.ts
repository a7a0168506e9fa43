import { withGpuPixels, type FrameBytes } from './gpu-pixels.js';
import { addLoss, decibelsOf, type LossSum, type Pixels } from './loss.js';

/** Maximum number of sampled blocks across and down the image, and the side of a block in pixels. */
const [BLOCKS, SIDE] = [6, 32];
/** Number of cells of the coverage grid, across and down. */
const CELLS = 64;
/** Number of samples of a cell, across and down. */
const SAMPLES = 4;

/** A block of the image, and the position of its first pixel. */
interface Block extends Pixels {
  readonly x: number;
  readonly y: number;
}

/**
 * Returns the loss of frames with fewer pixels, by their scale: the PSNR in dB over the covered pixels of blocks that
 * are spread over the image. The work is divided into tasks of a few milliseconds.
 * @param canvas Canvas whose frame was drawn in the current task.
 * @param scales Fractions of the width and the height that reduced frames have.
 * @param drawn Resolves when the GPU has drawn the frame. Reading a bitmap of the frame earlier would block the page.
 */
export async function lossesOf(
  canvas: HTMLCanvasElement,
  scales: readonly number[],
  drawn: Promise<unknown>,
): Promise<Map<number, number>> {
  const blocks = (await withGpuPixels(canvas, blocksOfBytes)) ?? (await blocksOfBitmap(canvas, drawn));
  const found = new Map<number, number>();
  for (const scale of scales) {
    const sum: LossSum = { sum: 0, values: 0 };
    for (const { x, y, ...pixels } of blocks) addLoss(pixels, scale, x, y, sum);
    found.set(scale, decibelsOf(sum));
    await new Promise((resolve) => setTimeout(resolve));
  }
  return found;
}

/** The first pixel of a block, and its column and row among the blocks. */
interface Place {
  readonly x: number;
  readonly y: number;
  readonly column: number;
  readonly row: number;
}

/**
 * Returns the places of blocks that are spread over the covered area. In a small area they are closer together, so that
 * it does not lie entirely within the edges of blocks, which are not compared.
 * @param isCovered Returns whether a cell, by its index in the grid, contains covered pixels.
 */
function placesOf(image: Pick<Pixels, 'width' | 'height'>, isCovered: (cell: number) => boolean): Place[] {
  const { x, y, width, height } = coveredOf(image, isCovered);
  const [columns, rows] = [width, height].map((pixels) => Math.min(BLOCKS, Math.ceil((2 * pixels) / SIDE)));
  return Array.from({ length: columns * rows }, (_, k) => {
    const [column, row] = [k % columns, Math.floor(k / columns)];
    const left = firstOf(x + ((column + 0.5) * width) / columns, image.width);
    const top = firstOf(y + ((row + 0.5) * height) / rows, image.height);
    return { x: left, y: top, column, row };
  });
}

const sideOf = (pixels: number): number => Math.min(SIDE, pixels);

function blocksOfBytes({ bytes, width, height, rowBytes }: FrameBytes): Block[] {
  // A cell is covered if the alpha of one of its samples is above 0.
  const isCovered = (cell: number): boolean => {
    for (let k = 0; k < SAMPLES * SAMPLES; k++) {
      const x = ((cell % CELLS) + ((k % SAMPLES) + 0.5) / SAMPLES) / CELLS;
      const y = (Math.floor(cell / CELLS) + (Math.floor(k / SAMPLES) + 0.5) / SAMPLES) / CELLS;
      if (bytes[rowBytes * Math.floor(y * height) + 4 * Math.floor(x * width) + 3] > 0) return true;
    }
    return false;
  };
  const [across, down] = [sideOf(width), sideOf(height)];
  return placesOf({ width, height }, isCovered).map(({ x, y }) => {
    // The order of the color channels does not matter, because the errors of all channels are added.
    const part = partOf(bytes, rowBytes / 4, x, y, across, down);
    return { x, y, width: across, height: down, values: Float32Array.from(part, (value) => value / 255) };
  });
}

async function blocksOfBitmap(canvas: HTMLCanvasElement, drawn: Promise<unknown>): Promise<Block[]> {
  const image = await createImageBitmap(canvas);
  await drawn;
  const [across, down] = [sideOf(image.width), sideOf(image.height)];
  const small = contextOf(CELLS, CELLS);
  small.drawImage(image, 0, 0, CELLS, CELLS);
  const cells = small.getImageData(0, 0, CELLS, CELLS).data;
  const places = placesOf(image, (cell) => cells[4 * cell + 3] > 0);
  const { column, row } = places[places.length - 1];
  const [width, height] = [(column + 1) * SIDE, (row + 1) * SIDE];
  const context = contextOf(width, height);
  for (const { x, y, column, row } of places)
    context.drawImage(image, x, y, SIDE, SIDE, column * SIDE, row * SIDE, SIDE, SIDE);
  image.close();
  // All blocks are read at once, because each read waits for the GPU.
  const { data } = context.getImageData(0, 0, width, height);
  return places.map(({ x, y, column, row }) => ({
    ...{ x, y, width: across, height: down },
    values: premultiplied(partOf(data, width, column * SIDE, row * SIDE, across, down)),
  }));
}

/** Returns a copy of a rectangle of pixels with 4 channels; `ofWidth` is the width of the source in pixels. */
function partOf(
  data: Uint8ClampedArray | Uint8Array,
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

/** Returns the first pixel, along one axis, of a block around a position, so that the block lies within the image. */
const firstOf = (middle: number, pixels: number): number =>
  Math.max(0, Math.min(pixels - SIDE, Math.round(middle - SIDE / 2)));

/** Returns the bounds of the covered cells in pixels; the entire image if no cell is covered. */
function coveredOf(
  image: Pick<Pixels, 'width' | 'height'>,
  isCovered: (cell: number) => boolean,
): Pick<DOMRect, 'x' | 'y' | 'width' | 'height'> {
  const covered = Array.from({ length: CELLS * CELLS }, (_, cell) => cell).filter(isCovered);
  const [columns, rows] = [covered.map((i) => i % CELLS), covered.map((i) => Math.floor(i / CELLS))];
  const [x, width] = span(columns, image.width);
  const [y, height] = span(rows, image.height);
  return { x, y, width, height };
}

/**
 * Returns the first pixel, and the number of pixels, of the range from the smallest cell to the largest along one axis.
 */
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
