import type { GaussianCloud } from '@gaussian-splat/core';
import { scaleRotationFactor, splatRows } from '@gaussian-splat/renderer/stages';

const root = new Float64Array(6);

/** Puts centre and covariance of a splat into its row, laid out as the renderer lays out splats that it merges. @param rows [N, ROW] */
export function writeRow(cloud: GaussianCloud, i: number, rows: Float64Array): void {
  const p = splatRows.ROW * i;
  scaleRotationFactor(cloud, i, root);
  splatRows.covarianceOf(root, 0, rows, p);
  rows[p + splatRows.X] = cloud.positions[3 * i];
  rows[p + splatRows.Y] = cloud.positions[3 * i + 1];
  rows[p + splatRows.Z] = cloud.positions[3 * i + 2];
}
