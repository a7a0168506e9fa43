import { shCoefficientCount } from '@gaussian-splat/core';
import type { Columns } from './parts/cloud-memory.js';

/** Input of {@link takeSplats}. */
export interface Taking {
  readonly from: Columns;
  readonly to: Columns;
  /** Indices of the splats in `from`. */
  readonly kept: Uint32Array;
  /** Degree of spherical harmonics that each of these splats keeps. */
  readonly degrees: Uint8Array;
  /** Index in `to` of the first of these splats. */
  readonly at: number;
}

/** Copies the splats `kept` to consecutive rows of `to`. Coefficients of splats with a reduced degree are not copied. */
export function takeSplats({ from, to, kept, degrees, at }: Taking): void {
  takeRows(from.positions, to.positions, 3, kept, at);
  takeRows(from.scales, to.scales, 3, kept, at);
  takeRows(from.rotations, to.rotations, 4, kept, at);
  takeRows(from.opacities, to.opacities, 1, kept, at);
  const [stride, length] = [3 * shCoefficientCount(from.shDegree), 3 * shCoefficientCount(to.shDegree)];
  for (let k = 0; k < kept.length; k++) {
    if (degrees[k] < from.shDegree) continue;
    const [source, target] = [stride * kept[k], length * (at + k)];
    for (let number = 0; number < length; number++) to.sh[target + number] = from.sh[source + number];
  }
}

function takeRows(from: Float32Array, to: Float32Array, width: number, kept: Uint32Array, at: number): void {
  for (let k = 0; k < kept.length; k++) {
    const [source, target] = [width * kept[k], width * (at + k)];
    for (let column = 0; column < width; column++) to[target + column] = from[source + column];
  }
}
