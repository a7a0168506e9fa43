import type { Slice } from './rasterizer.js';

/** A part of an image, in tiles. */
export interface TileRange {
  readonly column: number;
  readonly row: number;
  readonly columns: number;
  readonly rows: number;
}

/**
 * One of `count` parts of a grid of tiles; together they are the grid, each tile once. Whole rows while there are enough of them, else pieces of rows. Where there
 * are more parts than tiles, some are empty.
 */
export function sliceOfTiles(columns: number, rows: number, { index, count }: Slice): TileRange {
  const perBand = Math.ceil(count / rows);
  const bands = Math.ceil(count / perBand);
  const band = Math.floor(index / perBand);
  // The last band has what is left of the parts.
  const pieces = Math.min(perBand, count - perBand * band);
  const [row, nextRow] = part(rows, band, bands);
  const [column, nextColumn] = part(columns, index - perBand * band, pieces);
  return { column, row, columns: nextColumn - column, rows: nextRow - row };
}

const part = (length: number, index: number, count: number): [begin: number, end: number] => [
  Math.floor((index * length) / count),
  Math.floor(((index + 1) * length) / count),
];
