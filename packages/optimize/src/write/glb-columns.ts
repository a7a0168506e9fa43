import { shCoefficientCount } from '@gaussian-splat/core';
import type { Vector3 } from '@gaussian-splat/core';
import type { Columns } from '../parts/cloud-memory.js';

export const EXTENSION = 'KHR_gaussian_splatting';

/**
 * Signs of the coefficients of degrees 0 to 3 under the half turn about z from a cloud's axes (right, down, forward) to
 * glTF's (left, up, forward).
 */
const HALF_TURN = [1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1];

/** Signs of the coordinates x, y, z under the same half turn about z. */
const PLACE_SIGNS = [-1, -1, 1];

/** Splats of a block. All attributes of a block are written before the next one, so that its rows remain in the cache. */
const BLOCK = 256;

type Numbers = Float32Array | Int16Array;

/** A glTF attribute of a primitive of splats. Each splat takes a multiple of 4 bytes. */
export interface GlbColumn {
  readonly name: string;
  readonly width: number;
  readonly isShort?: boolean;
  /**
   * Writes the attribute of some splats.
   * @param out [splats.length, width]
   * @param splats Indices of the splats in the cloud.
   */
  readonly put: (out: Numbers, splats: Uint32Array) => void;
}

/** Returns the attributes of a primitive whose splats have this degree, 0..3. */
export function glbColumns(columns: Columns, degree: number): GlbColumn[] {
  const { positions, rotations, opacities, scales, sh, shDegree } = columns;
  /** Returns a float32 attribute: `width` values of each row of `stride`, from index `at` on, multiplied by a sign. */
  const plain = (name: string, values: Float32Array, stride: number, at: number, width: number, sign = 1) => ({
    name: `${EXTENSION}:${name}`,
    width,
    put: (out: Numbers, splats: Uint32Array): void => {
      for (let n = 0; n < splats.length; n++) {
        const from = stride * splats[n] + at;
        for (let k = 0; k < width; k++) out[width * n + k] = sign * values[from + k];
      }
    },
  });
  const stride = 3 * shCoefficientCount(shDegree);
  const colors = [0, 1, 2, 3].slice(0, degree + 1).flatMap((band) =>
    Array.from({ length: 2 * band + 1 }, (_, k) => {
      const n = band * band + k;
      return plain(`SH_DEGREE_${band}_COEF_${k}`, sh, stride, 3 * n, 3, HALF_TURN[n]);
    }),
  );
  return [
    { name: 'POSITION', width: 3, put: (out, splats) => putPlaces(positions, out, splats) },
    {
      ...{ name: `${EXTENSION}:ROTATION`, width: 4, isShort: true },
      put: (out, splats) => putRotations(rotations, out, splats),
    },
    plain('SCALE', scales, 3, 0, 3),
    plain('OPACITY', opacities, 1, 0, 1),
    ...colors,
  ];
}

/** Converts a point from a cloud's axes to glTF's axes. */
export const placeOf = (point: Vector3): number[] => point.map((x, axis) => PLACE_SIGNS[axis] * x);

/** Writes positions relative to the cloud's origin, in glTF's axes: [splats.length, 3]. */
function putPlaces(positions: Float32Array, out: Numbers, splats: Uint32Array): void {
  for (let n = 0; n < splats.length; n++) {
    for (let axis = 0; axis < 3; axis++) {
      out[3 * n + axis] = PLACE_SIGNS[axis] * positions[3 * splats[n] + axis];
    }
  }
}

/** Returns `min` and `max` of the accessor of positions, which glTF requires, in glTF's axes. */
export function placeBounds({ positions }: Columns, splats: Uint32Array): object {
  const [min, max] = [new Array<number>(3), new Array<number>(3)];
  for (let axis = 0; axis < 3; axis++) {
    let [lowest, highest] = [Infinity, -Infinity];
    for (let n = 0; n < splats.length; n++) {
      const place = PLACE_SIGNS[axis] * positions[3 * splats[n] + axis];
      if (place < lowest) lowest = place;
      if (place > highest) highest = place;
    }
    [min[axis], max[axis]] = [lowest, highest];
  }
  return { min, max };
}

/**
 * Writes rotations as normalized int16 in glTF's order (x, y, z, w). Each is the product of the half turn (0, 0, 0, 1) and
 * the cloud's rotation (w, x, y, z).
 */
function putRotations(rotations: Float32Array, out: Numbers, splats: Uint32Array): void {
  for (let n = 0; n < splats.length; n++) {
    const from = 4 * splats[n];
    out[4 * n] = Math.round(-32_767 * rotations[from + 2]);
    out[4 * n + 1] = Math.round(32_767 * rotations[from + 1]);
    out[4 * n + 2] = Math.round(32_767 * rotations[from]);
    out[4 * n + 3] = Math.round(-32_767 * rotations[from + 3]);
  }
}

/** Some splats of a primitive, and their destination in the file. */
export interface ColumnsToPut {
  readonly columns: Columns;
  readonly degree: number;
  /** Indices of the splats in the cloud. */
  readonly splats: Uint32Array;
  /** Index in the primitive of the first of {@link splats}. */
  readonly at: number;
  /** The file. */
  readonly bytes: Uint8Array;
  /** Byte offset in the file of each attribute of the primitive. */
  readonly starts: readonly number[];
}

/** Writes all attributes of some splats of a primitive. */
export function putColumns({ degree, splats, at, bytes, starts, columns }: ColumnsToPut): void {
  const outputs = glbColumns(columns, degree).map(({ width, isShort, put }, k) => {
    const start = bytes.byteOffset + starts[k] + (isShort ? 2 : 4) * width * at;
    const length = width * splats.length;
    const out = isShort ? new Int16Array(bytes.buffer, start, length) : new Float32Array(bytes.buffer, start, length);
    return { width, put, out };
  });
  for (let first = 0; first < splats.length; first += BLOCK) {
    const block = splats.subarray(first, first + BLOCK);
    for (const { width, put, out } of outputs) put(out.subarray(width * first, width * (first + block.length)), block);
  }
}
