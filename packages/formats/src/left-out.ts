/** Loaded where much of a file cannot be drawn. */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/** Of `GaussianCloud.faults`, in their order. */
const FAULTS = ['a scale below 0', 'no rotation', 'no extent', 'values that are not finite or too large'];
/** Of fewer than so many hundredths of the file's splats nobody can tell what the scene was. */
const LEAST_PERCENT = 10;

/**
 * The cloud with a warning of what it lacks.
 * @throws GaussianSplatError `decode/corrupt` where next to nothing is left
 */
export function withLeftOut(cloud: GaussianCloud, name: string): GaussianCloud {
  const { count, droppedCount, faults = [], warnings = [] } = cloud;
  const all = count + droppedCount;
  const reasons = FAULTS.flatMap((fault, k) => (faults[k] > 0 ? [`${grouped(faults[k])} with ${fault}`] : []));
  const found = `${grouped(droppedCount)} of ${grouped(all)} splats cannot be drawn: ${reasons.join(', ')}`;
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
