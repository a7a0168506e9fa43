import { constants } from '../generated/shaders.js';
import type { Vector3 } from '@gaussian-splat/core';
import { pageLayout, type PageFormat } from './manifest.js';

/** Where the words of the chunks of a slot lie: in a file that other pages share, and that nobody may change. */
export interface SlotWords {
  /** Laid out as docs/detail-pages.md describes a file of {@link of} chunks. */
  readonly words: Uint32Array<ArrayBuffer>;
  readonly of: number;
  /** The first of the slot's chunks in it, and how many there are. */
  readonly first: number;
  readonly chunks: number;
}

type Part = 'chunks' | 'details' | 'geometry' | 'sh';

const PARTS: readonly Part[] = ['chunks', 'details', 'geometry', 'sh'];

/** Where a part of a slot's words begins, and how many there are. */
export function rangeOf(
  { of, first, chunks }: SlotWords,
  part: Part,
  format: PageFormat,
): { at: number; size: number } {
  const layout = pageLayout(format, of);
  let at = 0;
  for (const before of PARTS) {
    if (before === part) break;
    at += layout[before];
  }
  const own = layout[part] / of;
  return { at: at + own * first, size: own * chunks };
}

/** A copy of a part of a slot's words, as numbers. */
export function numbersOf(slot: SlotWords, part: Part, format: PageFormat): Float32Array<ArrayBuffer> {
  const { at, size } = rangeOf(slot, part, format);
  const { buffer, byteOffset } = slot.words;
  return new Float32Array(buffer, byteOffset + 4 * at, size).slice();
}

/** Bytes that a slot's words have. */
export const byteLengthOf = ({ chunks }: SlotWords, format: PageFormat): number => 4 * pageLayout(format, chunks).total;

/** Words of a page that lie slot by slot, each laid out on its own, all but the last full. */
export function slotBySlot(words: Uint32Array<ArrayBuffer>, format: PageFormat): SlotWords[] {
  const [chunk, slot] = [pageLayout(format, 1).total, pageLayout(format, constants.SLOT_CHUNKS).total];
  return Array.from({ length: Math.ceil(words.length / slot) }, (_, k) => {
    const own = words.subarray(slot * k, slot * (k + 1));
    const chunks = own.length / chunk;
    return { words: own, of: chunks, first: 0, chunks };
  });
}

/** Moves the points that begin at every so many numbers. */
export function movePoints(numbers: Float32Array, first: number, stride: number, [x, y, z]: Vector3): void {
  for (let at = first; at < numbers.length; at += stride) {
    numbers[at] += x;
    numbers[at + 1] += y;
    numbers[at + 2] += z;
  }
}
