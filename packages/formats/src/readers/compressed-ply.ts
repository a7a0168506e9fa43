import { GaussianSplatError, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { allocateCloud, expInPlace, keptDegree, SH_C0, type DraftCloud } from '../cloud.js';
import { harmonicTargets, loadMetadata, shDegreeOf } from '../ply/gaussian-layout.js';
import { parsePlyHeader, type PlyElement, type PlyHeader } from '../ply/header.js';
import { openElement, readColumns, type ElementData } from '../ply/rows.js';
import { unpackSplats } from '../ply/unpack-splats.js';
import type { SceneSource } from '../scene-format.js';

/** Number of splats that a row of the element `chunk` describes. */
const CHUNK_SPLATS = 256;
/** Minimum number of splats that are unpacked in WebAssembly, which must be compiled for this purpose. */
const MANY_SPLATS = 1 << 14;
const PACKED = ['packed_position', 'packed_rotation', 'packed_scale', 'packed_color'];
const BOUNDS = ['min_', 'max_', 'min_scale_', 'max_scale_'].flatMap((bound) => ['x', 'y', 'z'].map((a) => bound + a));
const COLOR_BOUNDS = ['min_', 'max_'].flatMap((bound) => ['r', 'g', 'b'].map((channel) => bound + channel));

/** Indices of bounds in the row of a chunk, which has {@link BOUNDS} and then {@link COLOR_BOUNDS}. */
const [MIN_POSITION, MAX_POSITION, MIN_SCALE, MAX_SCALE, MIN_COLOR, MAX_COLOR] = [0, 3, 6, 9, 12, 15];
const CHUNK_FLOATS = 18;

/**
 * Reads the compressed PLY of PlayCanvas and SuperSplat. A file has bounds for each 256 splats, four 32-bit words for each
 * splat relative to these bounds, and optional 8-bit spherical harmonics. The formulas are those of splat-transform
 * (`src/lib/readers/decompress-ply.ts`), except that opacities are not converted to logits, so that 255 is opacity 1.
 * Files with 12 chunk properties (before 2024) have colors 0..1 without bounds.
 */
export async function readCompressedPly(source: SceneSource): Promise<GaussianCloud> {
  const header = parsePlyHeader(source);
  const { sh } = checkElements(source, header);
  // Coefficients follow all splats. A file that is still loading is read without them.
  const degree = sh && !source.isPrefix ? shDegreeOf(source, sh) : 0;
  const bounds = readChunkBounds(source, header);
  const vertex = openElement(source, header, 'vertex');
  const rest = sh && !source.isPrefix ? openElement(source, header, 'sh') : undefined;
  const { count } = vertex.element;
  const cloud = allocateCloud(count, keptDegree(degree), source);
  const elements = { vertex, sh: rest, bounds, table: HARMONIC_OF_BYTE };
  if (count < MANY_SPLATS || !(await unpackSplats(elements, PACKED, cloud))) {
    unpackRows(vertex, bounds, cloud);
    if (rest) readHarmonics(rest, degree, cloud);
  }
  source.signal?.throwIfAborted();
  const meaning = await loadMetadata(header, source.name);
  meaning?.readComments(cloud, header.comments);
  meaning?.warnDropped(cloud, header, source.name);
  return cloud;
}

function checkElements(source: SceneSource, header: PlyHeader): { sh: PlyElement | undefined } {
  const element = (name: string): PlyElement | undefined => header.elements.find((found) => found.name === name);
  const fail = (where: string, expected: string, found: string): never => {
    throw new GaussianSplatError('decode/header', {
      where: `${source.name}, header of a compressed PLY${where}`,
      expected,
      found,
      remedy: 'export the file again, for example with SuperSplat or splat-transform',
    });
  };
  const require = (name: string, properties: readonly string[], type: string): PlyElement => {
    const found = element(name) ?? fail('', `an element "${name}"`, header.elements.map((e) => e.name).join(', '));
    const missing = properties.filter(
      (property) => !found.properties.some((p) => p.name === property && p.type === type && !p.listCountType),
    );
    if (missing.length > 0)
      fail(`, element "${name}"`, `properties of type ${type}`, `none named ${missing.join(', ')}`);
    return found;
  };
  const vertex = require('vertex', PACKED, 'uint32');
  const chunk = require('chunk', BOUNDS, 'float32');
  if (chunk.properties.length > BOUNDS.length) require('chunk', COLOR_BOUNDS, 'float32');
  const chunkCount = Math.ceil(vertex.count / CHUNK_SPLATS);
  if (chunk.count !== chunkCount) {
    fail(', element "chunk"', `${grouped(chunkCount)} rows, one for each 256 splats`, grouped(chunk.count));
  }
  const sh = element('sh');
  if (sh && sh.count !== vertex.count) {
    fail(', element "sh"', `${grouped(vertex.count)} rows, one for each splat`, grouped(sh.count));
  }
  if (sh) require('sh', sh.properties.filter((p) => p.name.startsWith('f_rest_')).map((p) => p.name), 'uint8');
  return { sh };
}

/** Returns bounds, [chunks, 18]. The bounds of colors are 0 and 1 if the file has none. */
function readChunkBounds(source: SceneSource, header: PlyHeader): Float32Array {
  const data = openElement(source, header, 'chunk');
  const bounds = new Float32Array(CHUNK_FLOATS * data.element.count);
  for (let at = MAX_COLOR; at < bounds.length; at += CHUNK_FLOATS) bounds.fill(1, at, at + 3);
  readColumns(
    data,
    [...BOUNDS, ...COLOR_BOUNDS].map((property, offset) => ({
      property,
      array: bounds,
      stride: CHUNK_FLOATS,
      offset,
    })),
  );
  return bounds;
}

function unpackRows(vertex: ElementData, bounds: Float32Array, cloud: DraftCloud): void {
  const { count, positions, scales, rotations, opacities, sh } = cloud;
  const words = new Uint32Array(4 * count);
  readColumns(
    vertex,
    PACKED.map((property, offset) => ({ property, array: words, stride: 4, offset })),
  );
  const shStride = 3 * shCoefficientCount(cloud.shDegree);
  for (let i = 0; i < count; i++) {
    const chunk = CHUNK_FLOATS * Math.floor(i / CHUNK_SPLATS);
    unpack111011(words[4 * i], bounds, chunk + MIN_POSITION, chunk + MAX_POSITION, positions, 3 * i);
    unpackRotation(words[4 * i + 1], rotations, 4 * i);
    unpack111011(words[4 * i + 2], bounds, chunk + MIN_SCALE, chunk + MAX_SCALE, scales, 3 * i);
    const color = words[4 * i + 3];
    for (let channel = 0; channel < 3; channel++) {
      const t = ((color >>> (24 - 8 * channel)) & 255) / 255;
      const value = mix(bounds[chunk + MIN_COLOR + channel], bounds[chunk + MAX_COLOR + channel], t);
      sh[shStride * i + channel] = (value - 0.5) / SH_C0;
    }
    opacities[i] = (color & 255) / 255;
  }
  expInPlace(scales);
}

function mix(a: number, b: number, t: number): number {
  return a * (1 - t) + b * t;
}

/**
 * Decodes three values between bounds from a word of 11, 10 and 11 bits; the first axis has the highest bits.
 * @param min Index in `bounds` of the three lower bounds.
 * @param max Index in `bounds` of the three upper bounds.
 */
function unpack111011(
  word: number,
  bounds: Float32Array,
  min: number,
  max: number,
  out: Float32Array,
  at: number,
): void {
  out[at] = mix(bounds[min], bounds[max], (word >>> 21) / 2047);
  out[at + 1] = mix(bounds[min + 1], bounds[max + 1], ((word >>> 11) & 1023) / 1023);
  out[at + 2] = mix(bounds[min + 2], bounds[max + 2], (word & 2047) / 2047);
}

/**
 * Decodes a quaternion (w, x, y, z). The highest 2 bits of the word are the index of the largest component, which is not
 * stored. Each other component has 10 bits, from -1/sqrt(2) to 1/sqrt(2).
 */
function unpackRotation(word: number, out: Float32Array, at: number): void {
  const largest = word >>> 30;
  let squares = 0;
  for (let component = 3, shift = 0; component >= 0; component--) {
    if (component === largest) continue;
    const value = (((word >>> shift) & 1023) / 1023 - 0.5) * Math.SQRT2;
    out[at + component] = value;
    squares += value * value;
    shift += 10;
  }
  out[at + largest] = Math.sqrt(Math.max(0, 1 - squares));
}

/** Coefficient, -4..4, of each byte. A byte is the center of an interval, except that 0 and 255 are -4 and 4. */
const HARMONIC_OF_BYTE = Float32Array.from({ length: 256 }, (_, byte) => {
  const fraction = byte === 0 ? 0 : byte === 255 ? 1 : (byte + 0.5) / 256;
  return (fraction - 0.5) * 8;
});

function readHarmonics(rest: ElementData, degree: number, cloud: DraftCloud): void {
  const kept = shCoefficientCount(cloud.shDegree);
  readColumns(rest, harmonicTargets(degree, cloud));
  for (let i = 0; i < cloud.count; i++) {
    for (let k = 3; k < 3 * kept; k++) cloud.sh[3 * kept * i + k] = HARMONIC_OF_BYTE[cloud.sh[3 * kept * i + k]];
  }
}
