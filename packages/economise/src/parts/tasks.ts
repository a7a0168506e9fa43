import { findPartners } from '../merge/pair-candidates.js';
import { orderAll } from '../order.js';
import { takeSplats } from '../take-splats.js';
import { putColumns } from '../write/glb-columns.js';
import { readPart } from './read-part.js';

/** Rows of `width` numbers each, and their destination. */
export interface RowsToPut {
  readonly rows: Float32Array;
  readonly width: number;
  /** Destination row in `to` of each. */
  readonly places: Uint32Array;
  readonly to: Float32Array;
  /** Length of a row of `to`. */
  readonly length: number;
}

/** Copies rows to the beginnings of longer ones. */
export function putRows({ rows, width, places, to, length }: RowsToPut): void {
  for (let n = 0; n < places.length; n++) {
    for (let k = 0; k < width; k++) to[length * places[n] + k] = rows[width * n + k];
  }
}

/** All tasks by name. A task modifies only memory of its input. */
export const tasks = { orderAll, takeSplats, putRows, putColumns, readPart, findPartners } as const;
