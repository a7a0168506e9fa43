import { LoadBudget, type LoadLimits } from './budget.js';
import type { ClipGroup, ClipIndex, ClipPart } from './clip.js';
import { clipPartBytes } from './clip/clip-parts.js';

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

/** Maximum sizes of a part over all groups of a clip: those of its GPU buffers. */
export interface ClipRoom {
  readonly rows: number;
  readonly planes: number;
  readonly frames: number;
}

/** Returns the room of each part of the groups. */
export function clipRooms({ groups }: Pick<ClipIndex, 'groups'>): ClipRoom[] {
  const rooms: ClipRoom[] = [];
  for (const { frames, parts } of groups)
    for (const [k, { splats, planes }] of parts.entries()) {
      const { rows, ...own } = rooms[k] ?? { rows: 0, planes: 0, frames: 0 };
      rooms[k] = {
        rows: Math.max(rows, splats),
        planes: Math.max(own.planes, planes),
        frames: Math.max(own.frames, frames),
      };
    }
  return rooms;
}

/**
 * Returns the bytes on the GPU of one group of the largest size and of the parts that never change, without coefficients
 * above degree 0.
 */
export const clipRoomBytes = (index: Pick<ClipIndex, 'groups' | 'still'>): number =>
  [...index.still, ...clipRooms(index).map(({ rows: splats, planes }) => ({ splats, planes }))].reduce(
    (sum, part) => sum + clipPartBytes(part),
    0,
  );

/**
 * Charges the memory of a clip's largest groups on the GPU to an account of the whole file.
 * @throws GaussianSplatError `out-of-memory/budget`
 */
export function takeClipRoom(index: ClipIndex, name: string, limits: LoadLimits = {}): void {
  new LoadBudget(index.byteLength, limits).take(clipRoomBytes(index), name);
}
