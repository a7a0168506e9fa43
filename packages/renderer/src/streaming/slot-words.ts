import { constants } from '../generated/shaders.js';
import type { Vector3 } from '@gaussian-splat/core';
import { pageLayout, type PageFormat } from './manifest.js';

/** Location of the words of a slot's chunks, in a file that other pages share. Do not modify it. */
export interface SlotWords {
  /** Words of the file, in the layout of docs/lod-format.md. */
  readonly words: Uint32Array<ArrayBuffer>;
  /** Number of chunks in the file. */
  readonly of: number;
  /** Index in the file of the slot's first chunk. */
  readonly first: number;
  /** Number of chunks in the slot. */
  readonly chunks: number;
}

type Part = 'chunks' | 'details' | 'geometry' | 'sh';

const PARTS: readonly Part[] = ['chunks', 'details', 'geometry', 'sh'];

/** Number of words of one chunk in each section. */
export type ChunkLayout = ReturnType<typeof pageLayout>;

export const chunkLayout = (format: PageFormat): ChunkLayout => pageLayout(format, 1);

/** Returns the index of the first word of a section of a slot. */
export function startOf({ of, first }: SlotWords, part: Part, layout: ChunkLayout): number {
  let before = 0;
  for (let k = 0; PARTS[k] !== part; k++) before += layout[PARTS[k]];
  return of * before + first * layout[part];
}

/** Returns a section of a slot's words as float32: a view, which must not be modified. */
export function numbersOf(slot: SlotWords, part: Part, layout: ChunkLayout): Float32Array<ArrayBuffer> {
  const { buffer, byteOffset } = slot.words;
  return new Float32Array(buffer, byteOffset + 4 * startOf(slot, part, layout), slot.chunks * layout[part]);
}

/** Divides the words of a page into slots, each with its own sections. All slots except the last are full. */
export function slotBySlot(words: Uint32Array<ArrayBuffer>, format: PageFormat): SlotWords[] {
  const [chunk, slot] = [pageLayout(format, 1).total, pageLayout(format, constants.SLOT_CHUNKS).total];
  return Array.from({ length: Math.ceil(words.length / slot) }, (_, k) => {
    const own = words.subarray(slot * k, slot * (k + 1));
    const chunks = own.length / chunk;
    return { words: own, of: chunks, first: 0, chunks };
  });
}

/**
 * Translates points in place, in float32 as shaders/move_slots.wgsl does. Allocates nothing, because hundreds of pages
 * may arrive in a frame.
 * @param first Index of the x coordinate of the first point.
 * @param end Upper limit of the indices.
 * @param stride Numbers from one point to the next.
 */
export function movePoints(numbers: Float32Array, first: number, end: number, stride: number, by: Vector3): void {
  const [x, y, z] = [Math.fround(by[0]), Math.fround(by[1]), Math.fround(by[2])];
  for (let at = first; at < end; at += stride) {
    numbers[at] += x;
    numbers[at + 1] += y;
    numbers[at + 2] += z;
  }
}
