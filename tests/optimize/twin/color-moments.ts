import { eyeOf, shCoefficientCount, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { PRIOR_VIEWS, type ReducedSh } from '../../../packages/optimize/src/score.js';
import { shBasis } from './color.js';

/**
 * Directions and weights of the views of each splat: for each the matrix of the basis functions against one another, weighted by the
 * energy of the views. It gives the coefficients of a lower degree that are nearest to the colors of the views, by least squares, and the remaining error.
 */
export class ColorMoments {
  readonly #cloud: GaussianCloud;
  readonly #size: number;
  /** [N, size·(size + 1) / 2]: lower triangles, rows outermost. */
  readonly #matrices: Float32Array;
  /** [N] the first entry's sum, without the basis: the energy of all views. */
  readonly #energy: Float32Array;
  #views = 0;

  constructor(cloud: GaussianCloud) {
    this.#cloud = cloud;
    this.#size = shCoefficientCount(cloud.shDegree);
    this.#matrices = new Float32Array(cloud.count * this.#length);
    this.#energy = new Float32Array(cloud.count);
  }

  get #length(): number {
    return (this.#size * (this.#size + 1)) / 2;
  }

  /** Adds a view's contributions. @param energy [N], see {@link Contributions} */
  add(view: Camera, energy: Float32Array): void {
    this.#views++;
    const { count, positions, origin, shDegree } = this.#cloud;
    const [size, matrices] = [this.#size, this.#matrices];
    const basis = new Float64Array(16);
    const eye = eyeOf(view.worldToCamera);
    for (let i = 0; i < count; i++) {
      if (energy[i] === 0) continue;
      const x = positions[3 * i] + origin[0] - eye[0];
      const y = positions[3 * i + 1] + origin[1] - eye[1];
      const z = positions[3 * i + 2] + origin[2] - eye[2];
      const norm = 1 / Math.sqrt(x * x + y * y + z * z);
      shBasis(shDegree, x * norm, y * norm, z * norm, basis);
      this.#energy[i] += energy[i];
      for (let row = 0, at = i * this.#length; row < size; row++) {
        const weight = energy[i] * basis[row];
        for (let column = 0; column <= row; column++, at++) matrices[at] += weight * basis[column];
      }
    }
  }

  /** Adds views from everywhere, with the energy that a splat has in the views that see it. To be called once, at the end. @param looks [N] */
  addPrior(looks: Uint16Array): void {
    for (let i = 0; i < this.#cloud.count; i++) {
      const weight = (PRIOR_VIEWS * this.#energy[i]) / Math.max(1, looks[i]) / (4 * Math.PI);
      for (let row = 0, at = i * this.#length; row < this.#size; at += ++row + 1) this.#matrices[at] += weight;
    }
  }

  /** The colors at every degree below the cloud's. */
  lowered(): ReducedSh[] {
    return Array.from({ length: this.#cloud.shDegree }, (_, degree) => this.#atDegree(degree));
  }

  #atDegree(degree: number): ReducedSh {
    const { count, sh } = this.#cloud;
    const kept = 3 * (degree + 1) ** 2;
    const all = new Float32Array(kept * count);
    const of = (i: number): Float32Array => all.subarray(kept * i, kept * i + kept);
    const lowered = { error: new Float32Array(count), of };
    const scale = 1 / (3 * Math.max(1, this.#views));
    for (let i = 0; i < count; i++) {
      const from = 3 * this.#size * i;
      all.set(sh.subarray(from, from + kept), kept * i);
      if (this.#energy[i] === 0) continue;
      const { shift, squares } = this.#lower(i, kept / 3);
      lowered.error[i] = scale * squares;
      for (let k = 0; k < kept; k++) all[kept * i + k] += shift[k];
    }
    return lowered;
  }

  /**
   * The best addition to the first coefficients when those after them are dropped, and the remaining squared error, all
   * channels.
   */
  #lower(i: number, kept: number): { shift: Float64Array; squares: number } {
    const [size, matrices, start] = [this.#size, this.#matrices, i * this.#length];
    const at = (row: number, column: number): number =>
      matrices[start + (row >= column ? (row * (row + 1)) / 2 + column : (column * (column + 1)) / 2 + row)];
    const { sh } = this.#cloud;
    // A·lost, with the matrix A and the dropped coefficients `lost`.
    const product = new Float64Array(3 * size);
    for (let row = 0; row < size; row++) {
      for (let column = kept; column < size; column++) {
        const value = at(row, column);
        const from = 3 * (size * i + column);
        for (let channel = 0; channel < 3; channel++) product[3 * row + channel] += value * sh[from + channel];
      }
    }
    let squares = 0;
    for (let k = 3 * kept; k < 3 * size; k++) squares += product[k] * sh[3 * size * i + k];
    const shift = solve(at, product, kept);
    for (let k = 0; k < 3 * kept; k++) squares -= product[k] * shift[k];
    return { shift, squares: Math.max(0, squares) };
  }
}

/** Solves for three right sides, [size, 3], by Cholesky's method. A direction that no view knows gets 0. */
function solve(at: (row: number, column: number) => number, right: Float64Array, size: number): Float64Array {
  const factor = new Float64Array(size * size);
  const x = right.slice(0, 3 * size);
  for (let row = 0; row < size; row++) {
    for (let column = 0; column <= row; column++) {
      let sum = at(row, column);
      for (let k = 0; k < column; k++) sum -= factor[row * size + k] * factor[column * size + k];
      if (column < row) factor[row * size + column] = sum * factor[column * size + column];
      // The diagonal is kept as its reciprocal.
      else factor[row * size + row] = sum > 1e-6 * at(row, row) ? 1 / Math.sqrt(sum) : 0;
    }
  }
  for (let row = 0; row < size; row++) {
    for (let c = 0; c < 3; c++) {
      for (let k = 0; k < row; k++) x[3 * row + c] -= factor[row * size + k] * x[3 * k + c];
      x[3 * row + c] *= factor[row * size + row];
    }
  }
  for (let row = size - 1; row >= 0; row--) {
    for (let c = 0; c < 3; c++) {
      for (let k = row + 1; k < size; k++) x[3 * row + c] -= factor[k * size + row] * x[3 * k + c];
      x[3 * row + c] *= factor[row * size + row];
    }
  }
  return x;
}
