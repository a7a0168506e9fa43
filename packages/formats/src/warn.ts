/** Loaded with readers of what may not be drawn whole: that of plain PLY is none of them. */
import type { DraftCloud } from './cloud.js';

/** What is said where degree 4 is cut to 3. */
export const DEGREE_4 =
  'Spherical harmonics of degree 4 are drawn up to degree 3; the finest changes of colour with direction are left out.';

/** Adds a sentence about what is not drawn, once. */
export function warn(cloud: DraftCloud, sentence: string): void {
  const { warnings = [] } = cloud;
  if (!warnings.includes(sentence)) cloud.warnings = [...warnings, sentence];
}
