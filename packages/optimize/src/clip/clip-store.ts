/** Stores the finished groups of a clip, so that an interrupted call of `codeClip` continues. */
import type { ShDegree } from '@gaussian-splat/core';
import type { ClipHead } from '@gaussian-splat/formats';
import type { SogChoice } from '../write/tune-sog.js';
import type { WrittenClipPart } from './clip-part.js';
import type { MotionSteps } from './curves.js';
import type { CodedGroup } from './group-coder.js';

/** Named files of a call of `codeClip`. The caller must empty it when options or frames change, and at the end. */
export interface ClipStore {
  /** Returns the bytes of a file; undefined if it was not written. */
  read(name: string): Promise<Uint8Array | undefined>;
  /** Writes a file as a whole: after an interruption, it has its old content or its new one. */
  write(name: string, bytes: Uint8Array): Promise<void>;
}

/** State between two groups. */
export interface ClipState {
  readonly facts: Omit<ClipHead, 'groups' | 'still' | 'grow' | 'framesPerSecond' | 'shDegree'> | undefined;
  readonly encoding: SogChoice | undefined;
  readonly steps: MotionSteps | undefined;
  readonly shDegree: ShDegree;
  /** Undefined before the first group. */
  readonly framesPerGroup: number | undefined;
  readonly grow: number;
  readonly largest: number;
  readonly splats: number;
  readonly passing: number;
  readonly groups: readonly CodedGroup[];
  readonly still: readonly WrittenClipPart[];
}

const STATE = 'state.json';
const nameOf = (group: number | string, part: number): string => `${group}-${part}.bin`;

/** Writes the last `added` groups and the state. Earlier groups are written already. */
export async function writeState(store: ClipStore, state: ClipState, added: number): Promise<void> {
  const first = state.groups.length - added;
  for (const [own, { parts }] of state.groups.slice(first).entries())
    for (const [k, { bytes }] of parts.entries()) await store.write(nameOf(first + own, k), bytes);
  if (first === 0) for (const [k, { bytes }] of state.still.entries()) await store.write(nameOf('still', k), bytes);
  const json = JSON.stringify(state, (key, value: unknown) => (key === 'bytes' ? undefined : value));
  // Groups are complete when the state names them.
  await store.write(STATE, new TextEncoder().encode(json));
}

export async function readState(store: ClipStore): Promise<ClipState | undefined> {
  const bytes = await store.read(STATE);
  if (!bytes) return undefined;
  const state = JSON.parse(new TextDecoder().decode(bytes)) as ClipState;
  const whole = async (parts: readonly WrittenClipPart[], group: number | string): Promise<WrittenClipPart[]> =>
    Promise.all(
      parts.map(async (part, k) => ({ ...part, bytes: new Uint8Array((await store.read(nameOf(group, k)))!) })),
    );
  const groups = await Promise.all(
    state.groups.map(async (group, k) => ({ ...group, parts: await whole(group.parts, k) })),
  );
  return { ...state, groups, still: await whole(state.still, 'still') };
}
