import { findPartners } from '../merge/pair-candidates.js';
import { orderAll } from '../order.js';
import { takeSplats } from '../take-splats.js';
import { putColumns } from '../write/glb-columns.js';
import { readPart } from './read-part.js';

/** Rows of `width` numbers each, and where they go. */
export interface RowsToPut {
  readonly rows: Float32Array;
  readonly width: number;
  /** Row of `to` that each of them begins. */
  readonly places: Uint32Array;
  readonly to: Float32Array;
  /** Numbers of a row of `to`. */
  readonly length: number;
}

/** Copies rows to the beginnings of longer ones, at their places. */
export function putRows({ rows, width, places, to, length }: RowsToPut): void {
  for (let n = 0; n < places.length; n++) {
    for (let k = 0; k < width; k++) to[length * places[n] + k] = rows[width * n + k];
  }
}

/** All that can be done in parts, by name. What a task changes lies in memory that its input brings. */
export const tasks = { orderAll, takeSplats, putRows, putColumns, readPart, findPartners } as const;
