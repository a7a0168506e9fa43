/** Warning and error for dropped splats. This module is loaded if many splats of a file cannot be drawn. */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from './bytes.js';
import { reasonsOf } from './scene-errors.js';

/** Minimum percentage of drawable splats. A scene with fewer is unrecognizable and is rejected. */
const MIN_PERCENT = 10;

/** Range of magnitudes of coordinates, units. Bytes in the wrong order give magnitudes from 1e-45 to 1e38. */
const [TINY, HUGE] = [1e-9, 1e9];

/**
 * Returns the cloud with an additional warning about its dropped splats.
 * @throws GaussianSplatError `decode/corrupt` if less than {@link MIN_PERCENT} of the splats are drawable, or if the
 * bytes of the coordinates seem to be in the wrong order.
 */
export function withLeftOut(cloud: GaussianCloud, name: string): GaussianCloud {
  const { count, droppedCount, faults = [], warnings = [] } = cloud;
  const all = count + droppedCount;
  const found = `${grouped(droppedCount)} of ${grouped(all)} splats cannot be drawn: ${reasonsOf(faults)}`;
  const isSwapped = hasSwappedBytes(cloud);
  if (100 * count >= MIN_PERCENT * all && !isSwapped)
    return { ...cloud, warnings: [...warnings, `${found}. They are left out.`] };
  throw new GaussianSplatError('decode/corrupt', {
    where: name,
    expected: 'a scene most of whose splats can be drawn',
    found,
    remedy: isSwapped
      ? 'export the scene again with the byte order that its header states, little-endian or big-endian'
      : faults[0] > 0
        ? 'export the scene again with scales that are 0 or more, not their logarithms'
        : 'export the scene again, and check the training for errors',
  });
}

/** Whether a third of the coordinates has magnitudes that no scene has. */
function hasSwappedBytes({ positions }: GaussianCloud): boolean {
  const odd = positions.reduce((sum, x) => sum + Number(x !== 0 && !(Math.abs(x) > TINY && Math.abs(x) < HUGE)), 0);
  return 3 * odd > positions.length;
}
