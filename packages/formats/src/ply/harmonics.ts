import { shCoefficientCount } from '@gaussian-splat/core';
import type { DraftCloud } from '../cloud.js';
import type { ColumnTarget } from './rows.js';

/**
 * Where the properties `f_rest_*` go. They hold the coefficients above the constant one channel by channel, red first;
 * a cloud holds the channels side by side. `degree` is that of the file; bands above the cloud's degree are left out.
 */
export function harmonicTargets(degree: number, cloud: DraftCloud): ColumnTarget[] {
  const kept = shCoefficientCount(cloud.shDegree);
  const stored = (degree + 1) ** 2 - 1;
  const targets: ColumnTarget[] = [];
  for (let channel = 0; channel < 3; channel++) {
    for (let k = 1; k < kept; k++) {
      const property = `f_rest_${channel * stored + k - 1}`;
      targets.push({ property, array: cloud.sh, stride: 3 * kept, offset: 3 * k + channel });
    }
  }
  return targets;
}
