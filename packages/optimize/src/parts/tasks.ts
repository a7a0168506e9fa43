import { findPartners } from '../merge/pair-candidates.js';
import { orderAll } from '../order.js';
import { takeSplats } from '../take-splats.js';
import { putColumns } from '../write/glb-columns.js';
import { readPart } from './read-part.js';

/** Input of {@link putRows}: rows of `width` numbers, and their destination. */
export interface RowsToPut {
  readonly rows: Float32Array;
  readonly width: number;
  /** [rows] index of each row's destination in `to`. */
  readonly places: Uint32Array;
  readonly to: Float32Array;
  /** Count of numbers of a row in `to`. */
  readonly length: number;
}

/** Copies each row to the beginning of a row of `to`, which may be longer. */
export function putRows({ rows, width, places, to, length }: RowsToPut): void {
  for (let n = 0; n < places.length; n++) {
    for (let k = 0; k < width; k++) to[length * places[n] + k] = rows[width * n + k];
  }
}

/** Tasks by name. A task modifies only memory of its input. */
export const tasks = { orderAll, takeSplats, putRows, putColumns, readPart, findPartners } as const;
