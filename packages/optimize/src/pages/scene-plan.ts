import { boundsOf, type Bounds, type Credits, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import { innerViewOf } from '@gaussian-splat/core/views';
import {
  choosePrecision,
  codesAlong,
  curveThrough,
  isOfPlanes,
  leafLevel,
  noiseIn,
  packedOrder,
  recentered,
  sampleAxis,
  shNumbers,
  sortByKey,
  type Curve,
  type DetailManifest,
} from '@gaussian-splat/renderer/tools';
import { MAX_SHELLS, shellsAround, type ShellCounts } from './shell-order.js';
import { referenceWeight } from './splat-weights.js';

/** Minimum number of splats of a sample, unless the scene has fewer. */
const SAMPLE = 65_536;

/**
 * Facts of a scene on which all of its chunks depend. They are found in a sample, so that parts of a scene that is larger
 * than the memory can be built apart.
 */
export interface ScenePlan extends Pick<
  DetailManifest,
  'shPrecision' | 'geometry' | 'antialiased' | 'filterVariance' | 'order' | 'origin' | 'bounds'
> {
  /** Credits that the manifest states. */
  readonly credits?: Credits | undefined;
  /** Curve that orders the splats; undefined if they keep the order of their file. */
  readonly curve: Curve | undefined;
  /** Center and extent that define shells; undefined if chunks are not limited by shells. */
  readonly shells: Curve | undefined;
  readonly isOfPlanes: boolean;
  /** Weight of a well visible splat; see `SplatWeights`. */
  readonly reference: number;
}

/** Returns the distance between the splats of the sample of a scene. */
export const sampleStep = (count: number): number => Math.max(1, Math.floor(count / SAMPLE));

/**
 * Returns the plan of a scene.
 * @param sample Every n-th usable splat of the scene, for the n of {@link sampleStep}, upright.
 * @param total Number of usable splats of the scene.
 * @param box Lower and upper corner of the centers of all splats in world units.
 */
export function planScene(
  sample: GaussianCloud,
  { min, max }: Pick<Bounds, 'min' | 'max'>,
  geometry?: 'quantized',
  total = sample.count,
): ScenePlan {
  const near = recentered(sample);
  const { positions, antialiased, filterVariance, origin, hints } = near;
  const all = indices(near.count);
  const isFlat = isOfPlanes(positions);
  const bounds = boundsOf(sample);
  const order = packedOrder(near);
  return {
    ...{
      geometry,
      antialiased,
      filterVariance,
      origin,
      order: hints?.order,
      credits: hints?.credits,
      isOfPlanes: isFlat,
    },
    bounds: { ...bounds, inside: innerViewOf(sample, bounds, total), min, max },
    shPrecision: choosePrecision(noiseIn(near, order), order.length),
    curve: curveThrough(positions, all),
    shells: geometry && !isFlat ? ([0, 1, 2].map((axis) => sampleAxis(positions, all, axis)) as Curve) : undefined,
    reference: referenceWeight(leafLevel(near, all)),
  };
}

/** Places of splats in the order of a scene: by shell, then by code, then by their order in the file. */
export interface SplatKeys {
  readonly shells: Uint8Array;
  readonly codes: Uint32Array;
}

/**
 * Returns the keys of splats.
 * @param positions [N, 3] relative to the origin of the plan.
 * @param first Index in the file of the first splat.
 */
export function keysOf({ curve, shells }: ScenePlan, positions: Float32Array, first = 0): SplatKeys {
  const all = indices(positions.length / 3);
  return {
    shells: shells ? shellsAround(shells, positions) : new Uint8Array(all.length),
    codes: curve ? codesAlong(curve, positions, all) : all.map((k) => first + k),
  };
}

/** Returns the indices of splats in the order of their keys. */
export function orderBy({ shells, codes }: SplatKeys): Uint32Array {
  const sorted = sortByKey(indices(codes.length), codes);
  return shells.some((shell) => shell > 0)
    ? sortByKey(
        sorted,
        sorted.map((k) => shells[k]),
        8,
      )
    : sorted;
}

/** Counts the splats of each shell. */
export function countShells({ shells }: SplatKeys, counts: ShellCounts = new Float64Array(MAX_SHELLS)): ShellCounts {
  for (const shell of shells) counts[shell]++;
  return counts;
}

/** Returns the sample of a cloud for {@link planScene}. @param usable Indices of its usable splats. */
export function sampleOf(cloud: GaussianCloud, usable: Uint32Array): GaussianCloud {
  const step = sampleStep(usable.length);
  const kept = usable.filter((_, k) => k % step === 0);
  if (kept.length === cloud.count) return cloud;
  const { positions, scales, rotations, opacities, sh, shDegree } = cloud;
  return {
    ...cloud,
    count: kept.length,
    ...{ positions: takeRows(positions, 3, kept), scales: takeRows(scales, 3, kept) },
    ...{ rotations: takeRows(rotations, 4, kept), opacities: takeRows(opacities, 1, kept) },
    sh: takeRows(sh, shNumbers(shDegree), kept),
  };
}

/** Returns the rows `kept` of an array, of `width` numbers each. */
export function takeRows(rows: Float32Array, width: number, kept: Uint32Array): Float32Array {
  const taken = new Float32Array(width * kept.length);
  kept.forEach((i, k) => {
    for (let n = 0; n < width; n++) taken[width * k + n] = rows[width * i + n];
  });
  return taken;
}

/** Returns the positions of a cloud relative to another origin. */
export function positionsFrom(origin: Vector3, cloud: Pick<GaussianCloud, 'origin' | 'positions'>): Float32Array {
  const shift = origin.map((x, axis) => cloud.origin[axis] - x);
  return shift.every((x) => x === 0) ? cloud.positions : cloud.positions.map((x, i) => x + shift[i % 3]);
}

function indices(count: number): Uint32Array {
  const all = new Uint32Array(count);
  for (let k = 0; k < count; k++) all[k] = k;
  return all;
}
