/** Loaded where much of a file cannot be drawn. */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from './bytes.js';
import { reasonsOf } from './scene-errors.js';

/** Of fewer than so many hundredths of the file's splats nobody can tell what the scene was. */
const LEAST_PERCENT = 10;

/**
 * The cloud with a warning of what it lacks.
 * @throws GaussianSplatError `decode/corrupt` where next to nothing is left
 */
export function withLeftOut(cloud: GaussianCloud, name: string): GaussianCloud {
  const { count, droppedCount, faults = [], warnings = [] } = cloud;
  const all = count + droppedCount;
  const found = `${grouped(droppedCount)} of ${grouped(all)} splats cannot be drawn: ${reasonsOf(faults)}`;
  if (100 * count >= LEAST_PERCENT * all) return { ...cloud, warnings: [...warnings, `${found}. They are left out.`] };
  throw new GaussianSplatError('decode/corrupt', {
    where: name,
    expected: 'splats most of which can be drawn',
    found,
    remedy:
      faults[0] > 0
        ? 'export the scene again with scales that are 0 or more, not their logarithms'
        : 'export the scene again, and look for what went wrong in training',
  });
}
