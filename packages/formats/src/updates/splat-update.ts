import {
  GaussianSplatError,
  shCoefficientCount,
  type ShDegree,
  type SplatFilter,
  type Vector3,
} from '@gaussian-splat/core';

/** Attributes of N splats, each in one float32 array. Names, orders and axes are those of `GaussianCloud`. */
export interface SplatArrays {
  /** [N, 3] centers in world units, relative to `origin`. */
  readonly positions?: Float32Array | undefined;
  /** [N, 3] standard deviations in world units; with `raw` their natural logarithms. */
  readonly scales?: Float32Array | undefined;
  /** [N, 4] quaternions (w, x, y, z) of any length above 0. */
  readonly rotations?: Float32Array | undefined;
  /** [N] opacities, 0..1; with `raw` their logits. */
  readonly opacities?: Float32Array | undefined;
  /** [N, (d + 1)², 3] spherical-harmonics coefficients of degree d, with red, green and blue innermost. */
  readonly sh?: Float32Array | undefined;
  /** [N, 3] red, green and blue, 0..1, sRGB-encoded, instead of `sh`. */
  readonly colors?: Float32Array | undefined;
}

/** New values of all splats of a scene, or of some. */
export interface SplatUpdate extends SplatArrays {
  /** Index of the first splat whose values change; undefined if the update is a whole scene. */
  readonly first?: number | undefined;
  /** Degree of `sh`; required if `sh` is the only array. Default: the degree that its length implies. */
  readonly shDegree?: ShDegree | undefined;
  /** Number that the sender chooses, such as the iteration of its training, 0..2³² - 1. Default 0. */
  readonly step?: number | undefined;
  /** Whether `scales` are logarithms and `opacities` logits, as trainers store them. Default false. */
  readonly raw?: boolean | undefined;
  /** World position of the local point (0, 0, 0) of `positions`. Default (0, 0, 0). A range has that of its scene. */
  readonly origin?: Vector3 | undefined;
  /** Low-pass filter of the training. Default `classic`. */
  readonly filter?: SplatFilter | undefined;
}

/** Number of splats of an update, and the degree of its harmonics: 0 without `sh`. */
export interface UpdateSize {
  readonly count: number;
  readonly shDegree: ShDegree;
}

/** Number of float32 of one splat in each array but `sh`. */
const NUMBERS = { positions: 3, scales: 3, rotations: 4, opacities: 1, colors: 3 } as const;
/** The arrays in the order of a message. */
export const ARRAYS = ['positions', 'scales', 'rotations', 'opacities', 'sh', 'colors'] as const;
export type ArrayName = (typeof ARRAYS)[number];
/** The arrays that every whole scene has. */
const REQUIRED = ARRAYS.slice(0, 4);

/** Returns the number of float32 of one splat in an array. */
export const numbersOf = (name: ArrayName, shDegree: ShDegree): number =>
  name === 'sh' ? 3 * shCoefficientCount(shDegree) : NUMBERS[name];

/**
 * Checks the arrays of an update, and returns their number of splats and their degree of harmonics (0 without `sh`).
 * Single values are not read: splats with NaN or infinite values are not drawn.
 * @throws GaussianSplatError `argument/cloud` for a missing array, for lengths that do not match, and for both `sh` and
 * `colors`.
 */
export function checkUpdate(update: SplatUpdate): UpdateSize {
  const { first, sh, colors } = update;
  const found = ARRAYS.filter((name) => update[name] !== undefined);
  for (const name of found)
    if (!(update[name] instanceof Float32Array)) throw unfit(name, 'a Float32Array', typeof update[name]);
  const missing = first === undefined ? REQUIRED.find((name) => !found.includes(name)) : undefined;
  if (missing) throw unfit(missing, 'a Float32Array, because a whole scene has all attributes', 'none');
  const hasBoth = sh !== undefined && colors !== undefined;
  if (hasBoth || (first === undefined && !sh && !colors))
    throw unfit('sh', 'either sh or colors', hasBoth ? 'both' : 'neither');
  const counter = found.find((name) => name !== 'sh' || update.shDegree !== undefined);
  if (counter === undefined)
    throw unfit('positions', 'an array that gives the number of splats', sh ? 'sh without shDegree' : 'none');
  const count = update[counter]!.length / numbersOf(counter, update.shDegree ?? 0);
  const degrees = update.shDegree === undefined ? ([0, 1, 2, 3] as const) : [update.shDegree];
  const shDegree = sh ? degrees.find((degree) => sh.length === numbersOf('sh', degree) * count) : 0;
  if (!Number.isInteger(count)) throw unfit(counter, 'whole splats', `${update[counter]!.length} numbers`);
  if (shDegree === undefined)
    throw unfit('sh', `${degrees.map((d) => numbersOf('sh', d)).join(', ')} numbers a splat`, perSplat(sh!, count));
  for (const name of found)
    if (update[name]!.length !== numbersOf(name, shDegree) * count)
      throw unfit(name, `${numbersOf(name, shDegree)} numbers a splat`, perSplat(update[name]!, count));
  return { count, shDegree };
}

const perSplat = ({ length }: Float32Array, count: number): string => `${length} for ${count} splats`;

const unfit = (name: ArrayName, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('argument/cloud', {
    where: `splats.${name}`,
    expected,
    found,
    remedy: 'pass arrays of the same number of splats: docs/guide/changing-scenes.md has their shapes',
  });
