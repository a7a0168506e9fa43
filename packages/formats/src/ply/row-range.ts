import type { GaussianCloud } from '@gaussian-splat/core';
import { keptDegree } from '../cloud.js';
import { readPly } from '../readers/ply.js';
import type { SceneSource, SplatRange } from '../scene-format.js';
import { MAX_HEADER_BYTES } from '../signatures.js';
import type { SplatRanges } from '../splat-ranges.js';
import { findGaussians, TRAILING, withPlainNames } from './gaussian-layout.js';
import { exceedsFloat32, parsePlyHeader } from './header.js';
import { openElement } from './rows.js';

/**
 * Returns the properties of a PLY whose rows can be read independently. Undefined if rows differ in size, coordinates
 * need an origin, or a color space or safe orbit follows the rows.
 */
export function plyRanges(source: SceneSource): SplatRanges | undefined {
  const header = withPlainNames(parsePlyHeader(source));
  const { vertex, degree } = findGaussians(source, header);
  if (header.elements.some(({ name }) => TRAILING.test(name))) return undefined;
  const { start, rowBytes } = openElement({ ...source, isPrefix: true }, header, 'vertex');
  const isCoarse = vertex.properties.some(({ name, type }) => /^[xyz]$/.test(name) && exceedsFloat32(type));
  if (rowBytes === undefined || rowBytes === 0 || isCoarse || start > MAX_HEADER_BYTES) return undefined;
  return { count: vertex.count, shDegree: keptDegree(degree), rows: { start, byteLength: rowBytes } };
}

/** Reads a range of the rows of a PLY: copies its header and these rows to a smaller file, which `readPly` reads. */
export function readPlyRange(source: SceneSource & { readonly range: SplatRange }): Promise<GaussianCloud> {
  const { bytes, range } = source;
  const { start, rowBytes = 0 } = openElement(source, parsePlyHeader(source), 'vertex');
  const rows = bytes.subarray(start + rowBytes * range.first, start + rowBytes * range.end);
  const part = new Uint8Array(start + rows.length);
  part.set(bytes.subarray(0, start));
  part.set(rows, start);
  return readPly({ ...source, bytes: part, isPrefix: true });
}
