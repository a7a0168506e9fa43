import type { Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { packShape } from '../pack/pack.js';
import { GEOMETRY_WORDS } from '../pack/words.js';
import type { PageFormat } from './manifest.js';
import { QUANTIZED_CHUNK_WORDS, readRow, ROW_CODES } from './quantized-geometry.js';
import { startOf, type ChunkLayout, type SlotWords } from './slot-words.js';

const { CULL_GROUP, QUANTIZED_HEAD_ROWS, QUANTIZED_T_ZERO, QUANTIZED_UV_ZERO, QUANTIZED_OPAQUE, QUANTIZED_SIZES } =
  constants;
/** Bounds of a chunk's header, as in quantized_gaussian.wgsl: log2 of a size, and a number whose square is finite. */
const [MAX_SIZE, MAX_NUMBER] = [constants.QUANTIZED_LARGEST_SIZE, 2 ** 59];

/**
 * Returns the splats of a slot in the exact layout, as shared/quantized_gaussian.wgsl reads them. Splats that are not
 * drawn have the position NaN.
 * @param by Translation in world units, added to all positions.
 * @returns [256 C, 8] words: `PackedGaussian` of shaders/shared/packed_gaussian.wgsl, for the C chunks of the slot.
 */
export function exactGeometry(
  slot: SlotWords,
  { geometry }: PageFormat,
  layout: ChunkLayout,
  by: Vector3,
): Uint32Array<ArrayBuffer> {
  const from = startOf(slot, 'geometry', layout);
  const length = CULL_GROUP * GEOMETRY_WORDS * slot.chunks;
  const words = geometry === undefined ? slot.words.slice(from, from + length) : new Uint32Array(length);
  const numbers = new Float32Array(words.buffer);
  if (geometry !== undefined)
    for (let chunk = 0; chunk < slot.chunks; chunk++)
      unpackChunk(slot.words, from + QUANTIZED_CHUNK_WORDS * chunk, words, CULL_GROUP * GEOMETRY_WORDS * chunk);
  for (let at = 0; at < length; at += GEOMETRY_WORDS) {
    // Padding has no opacity, whose upper bits are in the lower ones of the sixth word.
    const isDrawn = geometry !== undefined || (words[at + 5] & 0xff) !== 0;
    for (let axis = 0; axis < 3; axis++) numbers[at + axis] = isDrawn ? numbers[at + axis] + by[axis] : NaN;
  }
  return words;
}

function unpackChunk(from: Uint32Array, head: number, words: Uint32Array<ArrayBuffer>, first: number): void {
  const heads = new Float32Array(from.buffer, from.byteOffset, from.length).subarray(head, head + 8);
  const numbers = new Float32Array(words.buffer);
  const [smallest, step] = [heads[3], heads[7]];
  const isUsable =
    heads.every((value) => Math.abs(value) <= MAX_NUMBER) &&
    Math.max(Math.abs(smallest), Math.abs(smallest + QUANTIZED_SIZES * step)) <= MAX_SIZE;
  const codes = new Int32Array(ROW_CODES);
  const factor = new Float64Array(6);
  for (let k = 0; k < CULL_GROUP; k++) {
    const at = first + GEOMETRY_WORDS * k;
    readRow(from, head + 4 * (QUANTIZED_HEAD_ROWS + k), codes);
    const isDrawn = isUsable && codes[9] > 0;
    for (let axis = 0; axis < 3; axis++)
      numbers[at + axis] = isDrawn ? heads[axis] + heads[4 + axis] * codes[axis] : NaN;
    if (!isDrawn) continue;
    const t = codes[6] / QUANTIZED_T_ZERO - 1;
    const flat = Math.max(0, 1 - Math.abs(t));
    const second = 2 ** (smallest + step * codes[4]) / Math.hypot(t, flat);
    const [u, v] = [codes[7] / QUANTIZED_UV_ZERO - 1, codes[8] / QUANTIZED_UV_ZERO - 1];
    const [x, y] = [(u + v) / 2, (u - v) / 2];
    const z = Math.max(0, 1 - Math.abs(x) - Math.abs(y));
    const third = 2 ** (smallest + step * codes[5]) / Math.hypot(x, y, z);
    factor[0] = 2 ** (smallest + step * codes[3]);
    factor[1] = second * t;
    factor[2] = second * flat;
    factor[3] = third * x;
    factor[4] = third * y;
    factor[5] = third * z;
    packShape(words, at + 3, factor, codes[9] / QUANTIZED_OPAQUE);
  }
}
