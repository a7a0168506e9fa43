import type { GaussianCloud } from '@gaussian-splat/core';
import { keptDegree } from '../cloud.js';
import { readPly } from '../readers/ply.js';
import type { SceneSource, SplatRange } from '../scene-format.js';
import { MAX_HEADER_BYTES } from '../signatures.js';
import type { SplatRanges } from '../splat-ranges.js';
import { hostIsLittleEndian } from '../bytes.js';
import { findGaussians, TRAILING, withPlainNames, type GaussianLayout } from './gaussian-layout.js';
import { exceedsFloat32, parsePlyHeader, sizeOf, type PlyHeader } from './header.js';
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
  return {
    count: vertex.count,
    shDegree: keptDegree(degree),
    rows: { start, byteLength: rowBytes, columns: columnsOf(header, findGaussians(source, header)) },
  };
}

/** Byte offsets of the properties of plain splats: see `SplatRanges.rows`. */
function columnsOf({ encoding }: PlyHeader, layout: GaussianLayout): number[] | undefined {
  const { vertex, degree, colorIsSh, hasThirdScale, hasFilter } = layout;
  if (encoding !== 'little-endian' || !hostIsLittleEndian || !colorIsSh || !hasThirdScale || hasFilter)
    return undefined;
  const offsets = new Map<string, number>();
  let at = 0;
  for (const { name, type } of vertex.properties) {
    if (type === 'float32') offsets.set(name, at);
    at += sizeOf(type);
  }
  const perChannel = (degree + 1) ** 2 - 1;
  const rest = [0, 1, 2].flatMap((channel) =>
    Array.from({ length: 15 }, (_, k) => (k < perChannel ? `f_rest_${channel * perChannel + k}` : '')),
  );
  const columns = [...PLAIN_COLUMNS, ...rest].map((name) => (name === '' ? 0 : offsets.get(name)));
  return columns.every((column) => column !== undefined) ? columns : undefined;
}

const PLAIN_COLUMNS = [
  ...['x', 'y', 'z', 'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'],
  ...['opacity', 'f_dc_0', 'f_dc_1', 'f_dc_2'],
];

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
