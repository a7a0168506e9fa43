import { shCoefficientCount, type GaussianCloud, type LevelRun, type ShDegree } from '@gaussian-splat/core';
import { allocateCloud, type DraftCloud } from './cloud.js';
import { addCredits, joinCredits } from './credits.js';
import { warn } from './faults.js';
import type { SceneSource } from './scene-format.js';

/** Splats `first` to `first + count` of a cloud, excluding the latter. */
export interface CloudPart {
  readonly cloud: GaussianCloud;
  readonly first: number;
  readonly count: number;
}

/**
 * Copies parts of several clouds into a new cloud, in order. The new cloud has the highest degree of the parts; other
 * coefficients are padded with zeros. Its origin and hints are those of the part with the most splats, but its
 * credits are those of all parts.
 * @throws GaussianSplatError `out-of-memory/budget`
 */
export function mergeClouds(parts: readonly CloudPart[], source: Pick<SceneSource, 'budget' | 'name'>): DraftCloud {
  const count = parts.reduce((sum, part) => sum + part.count, 0);
  const degree = parts.reduce<ShDegree>((max, { cloud }) => (cloud.shDegree > max ? cloud.shDegree : max), 0);
  const merged = allocateCloud(count, degree, source);
  const largest = parts.reduce<CloudPart | undefined>(
    (max, part) => (part.count > (max?.count ?? -1) ? part : max),
    undefined,
  );
  merged.origin = largest?.cloud.origin ?? [0, 0, 0];
  merged.antialiased = parts.some(({ cloud }) => cloud.antialiased);
  merged.filterVariance = parts.find(({ cloud }) => cloud.antialiased)?.cloud.filterVariance;
  merged.hints = largest?.cloud.hints;
  addCredits(merged, joinCredits(parts.map(({ cloud }) => cloud.hints?.credits)));
  for (const { cloud } of parts) for (const sentence of cloud.warnings ?? []) warn(merged, sentence);
  let at = 0;
  for (const part of parts) {
    copyPart(part, merged, at);
    at += part.count;
  }
  return merged;
}

function copyPart({ cloud, first, count }: CloudPart, to: DraftCloud, at: number): void {
  const end = first + count;
  to.positions.set(cloud.positions.subarray(3 * first, 3 * end), 3 * at);
  for (let axis = 0; axis < 3; axis++) {
    const shift = cloud.origin[axis] - to.origin[axis];
    if (shift !== 0) for (let i = at; i < at + count; i++) to.positions[3 * i + axis] += shift;
  }
  to.scales.set(cloud.scales.subarray(3 * first, 3 * end), 3 * at);
  to.rotations.set(cloud.rotations.subarray(4 * first, 4 * end), 4 * at);
  to.opacities.set(cloud.opacities.subarray(first, end), at);
  const [from, stride] = [3 * shCoefficientCount(cloud.shDegree), 3 * shCoefficientCount(to.shDegree)];
  if (from === stride) {
    to.sh.set(cloud.sh.subarray(from * first, from * end), stride * at);
  } else {
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < from; k++) to.sh[stride * (at + i) + k] = cloud.sh[from * (first + i) + k];
    }
  }
}

/** Part of a cloud, with the node of the scene that contains it, and its level of detail. */
export type NodePart = CloudPart & Pick<LevelRun, 'node' | 'level'>;

/** Returns the location of each part in the cloud that {@link mergeClouds} creates from these parts. */
export function levelRunsOf(parts: readonly NodePart[]): LevelRun[] {
  let first = 0;
  return parts.map(({ count, node, level }) => {
    const run = { first, count, node, level };
    first += count;
    return run;
  });
}
