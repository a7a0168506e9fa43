import { shCoefficientCount } from '@gaussian-splat/core';
import { readBackWith } from '@gaussian-splat/renderer/tools';
import type { SplatVisibility } from '../pages/splat-visibility.js';
import { layouts } from './layouts.js';
import type { SceneParts } from './scene-parts.js';

/**
 * Fraction of a splat's energy that is added as uniform visibility from all directions, so that all coefficients are
 * determined.
 */
const IMAGINED = 0.1;
/** Maximum number of entries of all roots, a gigabyte. For larger scenes, only energies are returned. */
const MAX_ROOTS = 2 ** 28;

/**
 * Returns the visibility of the splats of a scored scene. Results are read back part by part, because the moments of a
 * large scene have gigabytes.
 * @param views Number of scoring views.
 */
export async function seenIn(device: GPUDevice, scene: SceneParts, views: number): Promise<SplatVisibility> {
  const { count, shDegree } = scene.gaussians;
  const size = shCoefficientCount(shDegree);
  const numbers = shDegree > 0 ? (size * (size + 1)) / 2 : 0;
  const energies = new Float32Array(count);
  const hasRoots = numbers > 0 && numbers * count <= MAX_ROOTS;
  const roots = new Float32Array(hasRoots ? numbers * count : 0);
  const stride = layouts.Score.size / 4;
  const at = layouts.Score.fields.energy.offset / 4;
  for (const { page, first, row, scores, moments } of scene.parts) {
    const sums = new Float32Array(page.count);
    await readBackWith(device, [{ buffer: scores, byteLength: layouts.Score.size * page.count }], (mapped) => {
      const own = new Float32Array(mapped);
      for (let k = 0; k < page.count; k++) sums[k] = own[stride * k + at];
    });
    for (let k = 0; k < page.count; k++) energies[first + k] = sums[k] / views;
    if (!hasRoots) continue;
    await readBackWith(device, [{ buffer: moments, byteLength: 4 * numbers * row }], (mapped) => {
      putRoots(roots.subarray(numbers * first), new Float32Array(mapped), { row, size, sums });
    });
  }
  return { energies, roots };
}

/** Writes the lower triangular root (Cholesky) of each splat's moments, divided by its energy, to `roots`. */
function putRoots(
  roots: Float32Array,
  moments: Float32Array,
  { row, size, sums }: { row: number; size: number; sums: Float32Array },
): void {
  const numbers = (size * (size + 1)) / 2;
  const root = new Float64Array(numbers);
  sums.forEach((sum, i) => {
    if (!(sum > 0)) return;
    for (let r = 0, k = 0; r < size; r++) {
      const ofRow = (r * (r + 1)) / 2;
      for (let c = 0; c <= r; c++, k++) {
        const ofColumn = (c * (c + 1)) / 2;
        let rest = moments[row * k + i] / sum + (r === c ? IMAGINED / (4 * Math.PI) : 0);
        for (let j = 0; j < c; j++) rest -= root[ofRow + j] * root[ofColumn + j];
        root[k] = r === c ? Math.sqrt(Math.max(rest, 1e-12)) : rest / root[ofColumn + c];
      }
    }
    roots.set(root, numbers * i);
  });
}
