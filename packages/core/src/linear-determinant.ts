import type { Matrix4 } from './vector.js';

/** Returns the determinant of the linear part: its factor of volumes. */
export const linearDeterminant = (m: Matrix4): number =>
  m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
