import { GaussianSplatError, shCoefficientCount, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';

/** Allocator of memory that both tasks and their caller can access. */
export type Allocator = { allocate(byteLength: number): ArrayBufferLike };

/** Range of splats: indices from `first` to `end`, excluding `end`. */
export interface Part {
  readonly first: number;
  readonly end: number;
}

/** Arrays of a cloud, and its degree of spherical harmonics. */
export type Columns = Pick<GaussianCloud, 'positions' | 'scales' | 'rotations' | 'opacities' | 'sh' | 'shDegree'>;

/** Returns a cloud's arrays and degree without its other properties. */
export function columnsOf({ positions, scales, rotations, opacities, sh, shDegree }: GaussianCloud): Columns {
  return { positions, scales, rotations, opacities, sh, shDegree };
}

/** Returns a list of the arrays of a cloud. */
export function arraysOf({ positions, scales, rotations, opacities, sh }: Columns): Float32Array[] {
  return [positions, scales, rotations, opacities, sh];
}

/** Returns the count of numbers of each array for a splat. */
export const widthsOf = (degree: ShDegree) =>
  ({ positions: 3, scales: 3, rotations: 4, opacities: 1, sh: 3 * shCoefficientCount(degree) }) as const;

/**
 * Allocates the arrays of `count` splats in memory of a pool, filled with zeros.
 * @throws GaussianSplatError `out-of-memory/allocation`
 */
export function allocateColumns(count: number, shDegree: ShDegree, pool: Allocator): Columns {
  const widths = widthsOf(shDegree);
  const column = (name: keyof typeof widths): Float32Array =>
    new Float32Array(pool.allocate(4 * widths[name] * count), 0, widths[name] * count);
  try {
    return {
      ...{ positions: column('positions'), scales: column('scales'), rotations: column('rotations') },
      ...{ opacities: column('opacities'), sh: column('sh'), shDegree },
    };
  } catch (cause) {
    if (!(cause instanceof RangeError)) throw cause;
    throw new GaussianSplatError('out-of-memory/allocation', {
      where: `${count} splats of degree ${shDegree}`,
      expected: 'memory for their numbers',
      found: 'an allocation that failed',
      remedy: 'use a scene with fewer splats or a lower degree of spherical harmonics',
      cause,
    });
  }
}

/** Copies a cloud to arrays of its degree or a higher one, from splat `at` on. Other coefficients are not written. */
export function putCloud(cloud: GaussianCloud, to: Columns, at: number): void {
  to.positions.set(cloud.positions, 3 * at);
  to.scales.set(cloud.scales, 3 * at);
  to.rotations.set(cloud.rotations, 4 * at);
  to.opacities.set(cloud.opacities, at);
  const [from, stride] = [3 * shCoefficientCount(cloud.shDegree), 3 * shCoefficientCount(to.shDegree)];
  if (from === stride) {
    to.sh.set(cloud.sh, stride * at);
    return;
  }
  for (let i = 0; i < cloud.count; i++) {
    for (let k = 0; k < from; k++) to.sh[stride * (at + i) + k] = cloud.sh[from * i + k];
  }
}

/**
 * Moves the splats of parts together, in place, if parts have fewer splats than their reserved ranges.
 * @param runs Index of the first splat, and number of splats, of each part in ascending order.
 * @returns Arrays of all these splats, in the same memory.
 */
export function closeGaps(
  columns: Columns,
  runs: readonly { readonly first: number; readonly count: number }[],
): Columns & { readonly count: number } {
  const widths = widthsOf(columns.shDegree);
  const names = Object.keys(widths) as (keyof typeof widths)[];
  let total = 0;
  for (const { first, count } of runs) {
    if (first !== total) {
      for (const name of names) {
        const width = widths[name];
        columns[name].copyWithin(width * total, width * first, width * (first + count));
      }
    }
    total += count;
  }
  const cut = (name: keyof typeof widths): Float32Array => columns[name].subarray(0, widths[name] * total);
  return {
    ...{ count: total, positions: cut('positions'), scales: cut('scales'), rotations: cut('rotations') },
    ...{ opacities: cut('opacities'), sh: cut('sh'), shDegree: columns.shDegree },
  };
}
