/** Rotation of spherical harmonics by quaternions, as shaders/shared/turn_harmonics.wgsl does it. */
import { shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { shRotation } from '../transform/sh-rotation.js';

/** The reflection that exchanges y and z, that makes rotations about y. */
const EXCHANGE = [1, 0, 0, 0, 0, 1, 0, 1, 0] as const;
/** Coefficients of {@link EXCHANGE} in bands 1 to 3, row-major, computed at the first use. */
let exchanges: readonly Float64Array[] | undefined;

/**
 * Rotates coefficients of bands 1 to 3. A rotation is divided into rotations about z, y and z, and the one about y into
 * a rotation about z between two exchanges of axes. About z, only pairs of coefficients mix.
 */
export class HarmonicsTurner {
  readonly #degree: ShDegree;
  readonly #numbers: number;
  readonly #band = new Float64Array(7);
  readonly #other = new Float64Array(7);

  constructor(degree: ShDegree) {
    this.#degree = degree;
    this.#numbers = 3 * shCoefficientCount(degree);
    exchanges ??= ([1, 2, 3] as const).map((band) => shRotation(band, EXCHANGE));
  }

  /**
   * Rotates the coefficients of a splat in place.
   * @param sh [N, coefficients, 3]
   * @param quaternion w, x, y, z of unit length.
   */
  turn(sh: Float32Array, splat: number, [w, x, y, z]: readonly [number, number, number, number]): void {
    const [upright, tilted] = [Math.hypot(w, z), Math.hypot(x, y)];
    // Cosine and sine of half the sum, and half the difference, of the angles about z.
    const [p, q] = upright > 1e-9 ? [w / upright, z / upright] : [1, 0];
    const [r, s] = tilted > 1e-9 ? [y / tilted, x / tilted] : [1, 0];
    const before = [p * r - q * s, q * r + p * s] as const;
    const middle = [upright * upright - tilted * tilted, -2 * upright * tilted] as const;
    const after = [p * r + q * s, q * r - p * s] as const;
    const band = this.#band;
    for (let l = 1, first = 1; l <= this.#degree; first += 2 * l + 1, l++) {
      for (let channel = 0; channel < 3; channel++) {
        const at = splat * this.#numbers + 3 * first + channel;
        for (let k = 0; k <= 2 * l; k++) band[k] = sh[at + 3 * k];
        turnAboutZ(band, l, before);
        this.#exchange(l);
        turnAboutZ(band, l, middle);
        this.#exchange(l);
        turnAboutZ(band, l, after);
        for (let k = 0; k <= 2 * l; k++) sh[at + 3 * k] = band[k];
      }
    }
  }

  #exchange(l: number): void {
    const [band, other, matrix, size] = [this.#band, this.#other, exchanges![l - 1], 2 * l + 1];
    for (let row = 0; row < size; row++) {
      let sum = 0;
      for (let k = 0; k < size; k++) sum += matrix[size * row + k] * band[k];
      other[row] = sum;
    }
    band.set(other);
  }
}

/** Rotates a band of degree `l` about z, by the angle with the given cosine and sine. */
function turnAboutZ(band: Float64Array, l: number, [cos, sin]: readonly [number, number]): void {
  let [c, s] = [cos, sin];
  for (let m = 1; m <= l; m++) {
    const [plus, minus] = [band[l + m], band[l - m]];
    band[l + m] = c * plus - s * minus;
    band[l - m] = s * plus + c * minus;
    [c, s] = [c * cos - s * sin, s * cos + c * sin];
  }
}
