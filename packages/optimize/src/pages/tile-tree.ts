import {
  type ChunkErrors,
  constants,
  emptyLevel,
  FACTOR_NUMBERS,
  isOfPlanes,
  levelsAbove,
  shNumbers,
  type SplatLevel,
} from '@gaussian-splat/renderer/tools';
import type { Bounds, Vector3 } from '@gaussian-splat/core';
import { treeOf, type DetailTree } from './build-pages.js';
import { referenceWeight } from './splat-weights.js';

const { CULL_GROUP } = constants;

/**
 * Builds the tree above copies of another tree. Its finest level has the coarsest chunk of each copy, in the order of
 * `places`.
 * @param places Translation of each copy in units of the scene.
 */
export function instancedTree(tree: DetailTree, places: readonly Vector3[]): DetailTree {
  const top = tree.levels.length - 1;
  const finest = copiesOf(tree.levels[top], places);
  const levels = [finest, ...levelsAbove(finest)];
  const { radius } = tree.bounds;
  return {
    ...treeOf(levels, tree.geometry, errorsOfCopies(tree.errors[top], places)),
    splats: tree.splats * places.length,
    ...{
      shPrecision: tree.shPrecision,
      geometry: tree.geometry,
      antialiased: tree.antialiased,
      filterVariance: tree.filterVariance,
      order: tree.order,
      credits: tree.credits,
      origin: tree.origin,
    },
    isOfPlanes: isOfPlanes(finest.positions),
    reference: referenceWeight(finest),
    bounds: boundsAround(tree.bounds, places, radius),
  };
}

/** Returns a level with a chunk for each copy of the root chunk. Padding splats have opacity 0. */
function copiesOf(root: SplatLevel, places: readonly Vector3[]): SplatLevel {
  const level = emptyLevel(CULL_GROUP * places.length, root);
  const stride = shNumbers(root.shDegree);
  places.forEach((place, copy) => {
    for (let k = 0; k < CULL_GROUP; k++) {
      const [i, to] = [Math.min(k, root.count - 1), CULL_GROUP * copy + k];
      const from = root.shOrder === undefined ? i : root.shOrder[i];
      for (let axis = 0; axis < 3; axis++) level.positions[3 * to + axis] = root.positions[3 * i + axis] + place[axis];
      level.factors.set(root.factors.subarray(FACTOR_NUMBERS * i, FACTOR_NUMBERS * (i + 1)), FACTOR_NUMBERS * to);
      level.sh.set(root.sh.subarray(stride * from, stride * (from + 1)), stride * to);
      level.opacities[to] = k < root.count ? root.opacities[i] : 0;
      level.spreads[to] = root.spreads[i];
    }
  });
  return level;
}

function errorsOfCopies({ spheres, errors }: ChunkErrors, places: readonly Vector3[]): ChunkErrors {
  const moved = places.flatMap(([x, y, z]) => [spheres[0] + x, spheres[1] + y, spheres[2] + z, spheres[3]]);
  return {
    count: places.length,
    spheres: Float32Array.from(moved),
    errors: Float32Array.from(places, () => errors[0]),
  };
}

function boundsAround({ min, max }: Bounds, places: readonly Vector3[], own: number): Bounds {
  const corner = (from: Vector3, pick: (...values: number[]) => number): Vector3 =>
    [0, 1, 2].map((axis) =>
      places.reduce((found, place) => pick(found, from[axis] + place[axis]), from[axis] + places[0][axis]),
    ) as unknown as Vector3;
  const [low, high] = [corner(min, Math.min), corner(max, Math.max)];
  const center = [0, 1, 2].map((axis) => (low[axis] + high[axis]) / 2) as unknown as Vector3;
  return { min: low, max: high, center, radius: Math.max(own, Math.hypot(...high.map((x, axis) => x - center[axis]))) };
}
