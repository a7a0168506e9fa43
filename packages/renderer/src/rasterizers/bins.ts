import { constants } from '../generated/shaders.js';
import { specialise, type ShaderDescription } from '../gpu/kernel.js';

/** See the lever `bins`. */
export type BinSize = 'coarse' | 'fine';

/** Bins across and down of an image, and the bits of a bin's number. */
export interface Grid {
  readonly size: BinSize;
  readonly columns: number;
  readonly rows: number;
  readonly bits: number;
}

/** Tiles of a bin, across and down. */
const TILES: Readonly<Record<BinSize, readonly [columns: number, rows: number]>> = {
  coarse: [constants.BIN_COLUMNS, constants.BIN_ROWS],
  fine: [4, 2],
};
/** Room for pairs from which lists of fine bins pay for the second pass that sorting into so many bins takes. */
const MANY_PAIRS = 1 << 21;
/** Columns and rows of bins are kept in a byte each. */
const MOST_BINS = 255;

/** The bins of an image. @param pairCapacity pairs of splat and bin for which there is room */
export function gridOf(width: number, height: number, wanted: 'auto' | BinSize, pairCapacity: number): Grid {
  const fine = gridOfSize(width, height, 'fine');
  const isFine = wanted === 'auto' ? pairCapacity > MANY_PAIRS : wanted === 'fine';
  return isFine && Math.max(fine.columns, fine.rows) <= MOST_BINS ? fine : gridOfSize(width, height, 'coarse');
}

function gridOfSize(width: number, height: number, size: BinSize): Grid {
  const [across, down] = TILES[size];
  const columns = Math.ceil(width / (across * constants.TILE));
  const rows = Math.ceil(height / (down * constants.TILE));
  return { size, columns, rows, bits: Math.ceil(Math.log2(columns * rows)) };
}

/** A shader for bins of that size. */
export function withBins<S extends ShaderDescription>(shader: S, size: BinSize): S {
  if (size === 'coarse') return shader;
  const [[wide, high], [columns, rows]] = [TILES.coarse, TILES[size]];
  const narrow = specialise(shader, size, `const BIN_COLUMNS = ${wide}u`, `const BIN_COLUMNS = ${columns}u`);
  return specialise(narrow, 'rows', `const BIN_ROWS = ${high}u`, `const BIN_ROWS = ${rows}u`);
}
