import {
  quaternionOfMatrix,
  shCoefficientCount,
  symmetricEigen,
  type GaussianCloud,
  type Vector3,
} from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { shReader } from '../pack/unpack.js';
import { pageLayout, type DetailManifest } from './manifest.js';
import { QUANTIZED_CHUNK_WORDS, readRow, ROW_CODES } from './quantized-geometry.js';

const { CULL_GROUP, QUANTIZED_HEAD_ROWS, QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO, QUANTIZED_OPAQUE } = constants;

/** Selected chunks of a file of pages. */
export interface PageChunks {
  /** Words of the file, with geometry in the quantized layout of the GPU. */
  readonly words: Uint32Array<ArrayBuffer>;
  /** Number of chunks in the file. */
  readonly of: number;
  /** Indices of the selected chunks. */
  readonly chunks: readonly number[];
  /** Translation in world units, added to every position; default: none. */
  readonly translate?: Vector3;
}

/**
 * Returns the visible splats of some chunks as a cloud. Renderers without pages use it, and tools that compare pages
 * with their source scene.
 */
export function cloudOfChunks(
  scene: Pick<DetailManifest, 'shDegree' | 'shPrecision' | 'antialiased' | 'filterVariance' | 'origin'>,
  parts: readonly PageChunks[],
): GaussianCloud {
  const { shDegree, shPrecision, antialiased, filterVariance, origin } = scene;
  const max = CULL_GROUP * parts.reduce((sum, { chunks }) => sum + chunks.length, 0);
  const numbers = 3 * shCoefficientCount(shDegree);
  const [positions, scales] = [new Float32Array(3 * max), new Float32Array(3 * max)];
  const [rotations, opacities] = [new Float32Array(4 * max), new Float32Array(max)];
  const sh = new Float32Array(numbers * max);
  let count = 0;
  const codes = new Int32Array(ROW_CODES);
  for (const { words, of, chunks, translate = [0, 0, 0] } of parts) {
    const layout = pageLayout({ shDegree, shPrecision, geometry: 'quantized' }, of);
    const geometryAt = layout.chunks + layout.details;
    const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
    const harmonics = words.subarray(geometryAt + layout.geometry);
    const readSh = shReader({ sh: harmonics, shDegree, shPrecision });
    for (const chunk of chunks) {
      const at = geometryAt + QUANTIZED_CHUNK_WORDS * chunk;
      for (let k = 0; k < CULL_GROUP; k++) {
        readRow(words, at + 4 * (QUANTIZED_HEAD_ROWS + k), codes);
        if (codes[9] === 0) continue;
        for (let axis = 0; axis < 3; axis++) {
          const place = floats[at + axis] + floats[at + 4 + axis] * codes[axis];
          positions[3 * count + axis] = place + translate[axis];
        }
        const sizes = [0, 1, 2].map((n) => 2 ** (floats[at + 3] + floats[at + 7] * codes[3 + n]));
        const { values, vectors } = symmetricEigen(covarianceOf(sizes, codes));
        for (let n = 0; n < 3; n++) scales[3 * count + n] = Math.sqrt(Math.max(0, values[n]));
        rotations.set(quaternionOfMatrix(vectors), 4 * count);
        opacities[count] = Math.min(1, codes[9] / QUANTIZED_OPAQUE);
        readSh(CULL_GROUP * chunk + k, 1, sh.subarray(numbers * count));
        count++;
      }
    }
  }
  const cut = (values: Float32Array): Float32Array => values.subarray(0, (values.length / max) * count);
  return {
    ...{ count, origin, antialiased, filterVariance, shDegree, droppedCount: 0, positions: cut(positions) },
    ...{ scales: cut(scales), rotations: cut(rotations), opacities: cut(opacities), sh: cut(sh) },
  } as GaussianCloud;
}

function covarianceOf([a, second, third]: readonly number[], codes: Int32Array): number[] {
  const t = codes[6] / QUANTIZED_T_ZERO - 1;
  const [u, v] = [codes[7] / QUANTIZED_UV_ZERO - 1, codes[8] / QUANTIZED_UV_ZERO - 1];
  const [x, y] = [(u + v) / 2, (u - v) / 2];
  const [b, c] = scaled([t, 1 - Math.abs(t)], second);
  const [d, e, f] = scaled([x, y, Math.max(0, 1 - Math.abs(x) - Math.abs(y))], third);
  const [yx, zx, zy] = [a * b, a * d, b * d + c * e];
  return [a * a, yx, zx, yx, b * b + c * c, zy, zx, zy, d * d + e * e + f * f];
}

function scaled(direction: readonly number[], length: number): number[] {
  const own = Math.hypot(...direction);
  return direction.map((x) => (x * length) / own);
}
