import { constants } from '../generated/shaders.js';
import type { Vector3 } from '@gaussian-splat/core';
import { pageLayout, type PageFormat } from './manifest.js';

/** Where the words of the chunks of a slot lie: in a file that other pages share, and that nobody may change. */
export interface SlotWords {
  /** Laid out as docs/lod-format.md describes a file of {@link of} chunks. */
  readonly words: Uint32Array<ArrayBuffer>;
  readonly of: number;
  /** The first of the slot's chunks in it, and how many there are. */
  readonly first: number;
  readonly chunks: number;
}

type Part = 'chunks' | 'details' | 'geometry' | 'sh';

const PARTS: readonly Part[] = ['chunks', 'details', 'geometry', 'sh'];

/** Words of one chunk, part by part. */
export type ChunkLayout = ReturnType<typeof pageLayout>;

export const chunkLayout = (format: PageFormat): ChunkLayout => pageLayout(format, 1);

/** Where a part of a slot's words begins. */
export function startOf({ of, first }: SlotWords, part: Part, layout: ChunkLayout): number {
  let before = 0;
  for (let k = 0; PARTS[k] !== part; k++) before += layout[PARTS[k]];
  return of * before + first * layout[part];
}

/** A part of a slot's words, as numbers that nobody may change. */
export function numbersOf(slot: SlotWords, part: Part, layout: ChunkLayout): Float32Array<ArrayBuffer> {
  const { buffer, byteOffset } = slot.words;
  return new Float32Array(buffer, byteOffset + 4 * startOf(slot, part, layout), slot.chunks * layout[part]);
}

/** Words of a page that lie slot by slot, each laid out on its own, all but the last full. */
export function slotBySlot(words: Uint32Array<ArrayBuffer>, format: PageFormat): SlotWords[] {
  const [chunk, slot] = [pageLayout(format, 1).total, pageLayout(format, constants.SLOT_CHUNKS).total];
  return Array.from({ length: Math.ceil(words.length / slot) }, (_, k) => {
    const own = words.subarray(slot * k, slot * (k + 1));
    const chunks = own.length / chunk;
    return { words: own, of: chunks, first: 0, chunks };
  });
}

/** Moves the points that begin at every so many numbers, as shaders/move_slots.wgsl does: by float32. No array, no closure: hundreds of pages come in a frame. */
export function movePoints(numbers: Float32Array, first: number, end: number, stride: number, by: Vector3): void {
  const [x, y, z] = [Math.fround(by[0]), Math.fround(by[1]), Math.fround(by[2])];
  for (let at = first; at < end; at += stride) {
    numbers[at] += x;
    numbers[at + 1] += y;
    numbers[at + 2] += z;
  }
}
