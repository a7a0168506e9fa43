import type { GaussianCloud } from '@gaussian-splat/core';
import { keptDegree } from '../cloud.js';
import { readPly } from '../readers/ply.js';
import type { SceneSource, SplatRange } from '../scene-format.js';
import { MAX_HEADER_BYTES } from '../signatures.js';
import type { SplatRanges } from '../splat-ranges.js';
import { COLOR_SPACE, findGaussians, withPlainNames } from './gaussian-layout.js';
import { exceedsFloat32, parsePlyHeader } from './header.js';
import { openElement } from './rows.js';

/** Returns the location of a PLY's splats, or undefined if its rows differ in size or depend on one another. */
export function plyRanges(source: SceneSource): SplatRanges | undefined {
  const header = withPlainNames(parsePlyHeader(source));
  const { vertex, degree } = findGaussians(source, header);
  // The color-space element follows all rows.
  if (header.elements.some(({ name }) => name === COLOR_SPACE)) return undefined;
  const { start, rowBytes } = openElement({ ...source, isPrefix: true }, header, 'vertex');
  const isCoarse = vertex.properties.some(({ name, type }) => /^[xyz]$/.test(name) && exceedsFloat32(type));
  if (rowBytes === undefined || rowBytes === 0 || isCoarse || start > MAX_HEADER_BYTES) return undefined;
  return { count: vertex.count, shDegree: keptDegree(degree), rows: { start, byteLength: rowBytes } };
}

/** Reads some rows of a PLY, from a file with its header followed by only these rows. */
export function readPlyRange(source: SceneSource & { readonly range: SplatRange }): Promise<GaussianCloud> {
  const { bytes, range } = source;
  const { start, rowBytes = 0 } = openElement(source, parsePlyHeader(source), 'vertex');
  const rows = bytes.subarray(start + rowBytes * range.first, start + rowBytes * range.end);
  const part = new Uint8Array(start + rows.length);
  part.set(bytes.subarray(0, start));
  part.set(rows, start);
  return readPly({ ...source, bytes: part, isPrefix: true });
}
