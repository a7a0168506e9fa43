import type { LevelRun } from '@gaussian-splat/core';
import type { CloudPart } from '../merge-clouds.js';

/** Part of a cloud, and what it shows: a node of the scene at a level. */
export type NodePart = CloudPart & Pick<LevelRun, 'node' | 'level'>;

/** Where the parts lie once they are merged. */
export function levelRunsOf(parts: readonly NodePart[]): LevelRun[] {
  let first = 0;
  return parts.map(({ count, node, level }) => {
    const run = { first, count, node, level };
    first += count;
    return run;
  });
}
