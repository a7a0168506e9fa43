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
