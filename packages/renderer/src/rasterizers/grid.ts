/** The bins that the rasterizer `tiles` lists splats for. */
import { constants } from '../generated/shaders.js';
import type { FewTiles } from './few-tiles.js';
import type { Surface } from './rasterizer.js';
import type { TilePainter } from './tile-painter.js';

const { BIN_COLUMNS, BIN_ROWS, DIGITS, MAX_TILES, SMALL_TILE, TILES_PER_BIN } = constants;

/** Maximum number of bins of an image of few tiles. */
export const FEW_BINS = MAX_TILES / TILES_PER_BIN;

/** The bins of an image. */
export interface Grid {
  /** Side of a tile of the lists in pixels. */
  readonly tile: number;
  readonly columns: number;
  readonly rows: number;
  /** columns times rows */
  readonly count: number;
  /** Number of bits of the index of a bin. */
  readonly bits: number;
  /** Whether the image has so few tiles that a thread has one pixel. */
  readonly isFew: boolean;
  /** Whether long lists are divided. */
  readonly isDivided: boolean;
}

/**
 * Returns the bins for an image. Their tiles are small if one pass sorts the pairs by their bins.
 * @param few Kernels for images of few tiles; undefined if there are none.
 * @param hasLongLists Whether long lists of such an image are divided.
 */
export function gridFor(
  { width, height }: Pick<Surface, 'width' | 'height'>,
  painter: TilePainter,
  few: FewTiles | undefined,
  hasLongLists: boolean,
  tile: number = SMALL_TILE,
): Grid {
  const columns = Math.ceil(width / (BIN_COLUMNS * tile));
  const rows = Math.ceil(height / (BIN_ROWS * tile));
  const count = columns * rows;
  if (tile < SMALL_TILE && count > FEW_BINS) return gridFor({ width, height }, painter, few, hasLongLists);
  if (count > DIGITS && tile < painter.tile)
    return gridFor({ width, height }, painter, few, hasLongLists, painter.tile);
  const isFew = few !== undefined && painter.few !== undefined && count <= FEW_BINS;
  const isDivided = isFew && hasLongLists && !painter.hasWholeLists;
  return { tile, columns, rows, count, bits: Math.ceil(Math.log2(count)), isFew, isDivided };
}
