import { loadModule } from '@gaussian-splat/core';
import type { PlyHeader } from './header.js';
import type * as meaning from './meaning.js';

/** Names that plain splats do not have: of properties, and of elements. */
const ODD = /^(filter_3D|trbf_center|motion_0|f_anchor_feat_0|codebook_centers)$/;

/** What knows the meaning of a header that says more than which numbers follow; undefined for all others. */
export async function loadMeaning({ comments, elements }: PlyHeader): Promise<typeof meaning | undefined> {
  const isOdd = elements.some(({ name, properties }) => ODD.test(name) || properties.some((own) => ODD.test(own.name)));
  if (comments.length === 0 && !isOdd) return undefined;
  return loadModule('the code that reads what a PLY says of itself', () => import('./meaning.js'));
}
