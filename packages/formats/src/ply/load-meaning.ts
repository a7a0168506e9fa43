import { loadModule } from '@gaussian-splat/core';
import type { PlyHeader } from './header.js';
import type * as meaning from './meaning.js';

/** Properties that plain splats have, up to degree 3, packed ones too; normals mean nothing. */
export const PLAIN = /^(n?[xyz]|f_dc_\d|f_rest_([1-3]?\d|4[0-4])|opacity|(scale|rot)_\d|red|green|blue|packed_.*)$/;
/** Elements that say what the vertices are, or that are drawn beside them. */
const ODD = /^(face|tristrips|codebook_centers)$/;
/** LAM writes offsets from a mesh in place of positions, and only the name of the file tells it. */
export const OFFSETS = /offset\.ply$/i;

/** What knows the meaning of a header that says more than which numbers follow; undefined for all others. */
export async function loadMeaning(
  { comments, elements }: PlyHeader,
  fileName: string,
): Promise<typeof meaning | undefined> {
  const isOdd = elements.some(
    ({ name, properties }) =>
      ODD.test(name) || (/^(vertex|sh)$/.test(name) && properties.some((own) => !PLAIN.test(own.name))),
  );
  if (comments.length === 0 && !isOdd && !OFFSETS.test(fileName)) return undefined;
  return loadModule('the code that reads what a PLY says of itself', () => import('./meaning.js'));
}
