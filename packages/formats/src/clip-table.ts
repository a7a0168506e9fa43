import type { ClipGroup, ClipIndex, ClipPart } from './clip.js';

/** Number of values of a part in {@link ClipTable.parts}. */
const STRIDE = 4;

/**
 * Groups of a clip as arrays of numbers. Between threads, objects would take a hundred times the bytes of a hostile file.
 */
export interface ClipTable {
  /** Byte offset of the first part in the file. */
  readonly start: number;
  /** [G] number of frames of each group. */
  readonly frames: Uint16Array;
  /** [G] number of parts of each group. */
  readonly counts: Uint8Array;
  /** [P, 4] splats, planes, bytes of the scene and bytes of the motion of each part. */
  readonly parts: Uint32Array;
}

/** Index of a clip whose groups are a table, for messages between threads. */
export type PackedClipIndex = Omit<ClipIndex, 'groups'> & { readonly groups: ClipTable };

export function packClipIndex({ groups, ...facts }: ClipIndex): PackedClipIndex {
  const parts = groups.flatMap((group) => group.parts);
  const numbers = new Uint32Array(STRIDE * parts.length);
  for (const [k, { splats, planes, sceneBytes, motionBytes }] of parts.entries())
    numbers.set([splats, planes, sceneBytes, motionBytes], STRIDE * k);
  const table: ClipTable = {
    start: parts[0].start,
    frames: Uint16Array.from(groups, ({ frames }) => frames),
    counts: Uint8Array.from(groups, (group) => group.parts.length),
    parts: numbers,
  };
  return { ...facts, groups: table };
}

export function unpackClipIndex({ groups: table, ...facts }: PackedClipIndex): ClipIndex {
  let [first, start, at] = [0, table.start, 0];
  const groups = Array.from(table.frames, (frames, k): ClipGroup => {
    const parts = Array.from({ length: table.counts[k] }, (): ClipPart => {
      const [splats, planes, sceneBytes, motionBytes] = table.parts.subarray(at, (at += STRIDE));
      const part = { start, splats, planes, sceneBytes, motionBytes };
      start += sceneBytes + motionBytes;
      return part;
    });
    const group = { first, frames, parts };
    first += frames;
    return group;
  });
  return { ...facts, groups };
}
