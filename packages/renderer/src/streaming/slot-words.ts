import { constants } from '../generated/shaders.js';
import type { Vector3 } from '@gaussian-splat/core';
import { pageLayout, type PageFormat } from './manifest.js';

/** Location of the words of a slot's chunks: a read-only file that other pages share. */
export interface SlotWords {
  /** In the layout of docs/lod-format.md for a file of {@link of} chunks. */
  readonly words: Uint32Array<ArrayBuffer>;
  readonly of: number;
  /** Index of the slot's first chunk in it, and the number of chunks. */
  readonly first: number;
  readonly chunks: number;
}

type Part = 'chunks' | 'details' | 'geometry' | 'sh';

const PARTS: readonly Part[] = ['chunks', 'details', 'geometry', 'sh'];

/** Words of one chunk, section by section. */
export type ChunkLayout = ReturnType<typeof pageLayout>;

export const chunkLayout = (format: PageFormat): ChunkLayout => pageLayout(format, 1);

/** Start of a section of a slot's words. */
export function startOf({ of, first }: SlotWords, part: Part, layout: ChunkLayout): number {
  let before = 0;
  for (let k = 0; PARTS[k] !== part; k++) before += layout[PARTS[k]];
  return of * before + first * layout[part];
}

/** A section of a slot's words as read-only numbers. */
export function numbersOf(slot: SlotWords, part: Part, layout: ChunkLayout): Float32Array<ArrayBuffer> {
  const { buffer, byteOffset } = slot.words;
  return new Float32Array(buffer, byteOffset + 4 * startOf(slot, part, layout), slot.chunks * layout[part]);
}

/** Words of a page slot by slot, each with its own layout, all but the last full. */
export function slotBySlot(words: Uint32Array<ArrayBuffer>, format: PageFormat): SlotWords[] {
  const [chunk, slot] = [pageLayout(format, 1).total, pageLayout(format, constants.SLOT_CHUNKS).total];
  return Array.from({ length: Math.ceil(words.length / slot) }, (_, k) => {
    const own = words.subarray(slot * k, slot * (k + 1));
    const chunks = own.length / chunk;
    return { words: own, of: chunks, first: 0, chunks };
  });
}

/**
 * Translates points at a stride, in float32 as shaders/move_slots.wgsl does. Allocates nothing, because hundreds of
 * pages arrive in a frame.
 */
export function movePoints(numbers: Float32Array, first: number, end: number, stride: number, by: Vector3): void {
  const [x, y, z] = [Math.fround(by[0]), Math.fround(by[1]), Math.fround(by[2])];
  for (let at = first; at < end; at += stride) {
    numbers[at] += x;
    numbers[at + 1] += y;
    numbers[at + 2] += z;
  }
}
