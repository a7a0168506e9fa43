/** Warning and error for dropped splats. This module is loaded if many splats of a file cannot be drawn. */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from './bytes.js';
import { reasonsOf } from './scene-errors.js';

/** Minimum percentage of drawable splats. A scene with fewer is unrecognizable and is rejected. */
const MIN_PERCENT = 10;

/**
 * Returns the cloud with an additional warning about its dropped splats.
 * @throws GaussianSplatError `decode/corrupt` if less than {@link MIN_PERCENT} of the splats are drawable.
 */
export function withLeftOut(cloud: GaussianCloud, name: string): GaussianCloud {
  const { count, droppedCount, faults = [], warnings = [] } = cloud;
  const all = count + droppedCount;
  const found = `${grouped(droppedCount)} of ${grouped(all)} splats cannot be drawn: ${reasonsOf(faults)}`;
  if (100 * count >= MIN_PERCENT * all) return { ...cloud, warnings: [...warnings, `${found}. They are left out.`] };
  throw new GaussianSplatError('decode/corrupt', {
    where: name,
    expected: 'a scene most of whose splats can be drawn',
    found,
    remedy:
      faults[0] > 0
        ? 'export the scene again with scales that are 0 or more, not their logarithms'
        : 'export the scene again, and check the training for errors',
  });
}
