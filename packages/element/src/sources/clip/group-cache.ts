import { BackOff } from '@gaussian-splat/core/fetch';
import { clipPartBytes, type ClipIndex, type ClipPart } from '@gaussian-splat/formats';
import type { PackedAnimation } from '@gaussian-splat/renderer/tools';
import { indicesFrom } from '../play-direction.js';

/** Index in place of a group's for the parts that never change, which all groups share. */
export const STILL = -1;

/** Returns the parts of a group, or those that never change. */
export const partsIn = ({ groups, still }: ClipIndex, group: number): readonly ClipPart[] =>
  group === STILL ? still : groups[group].parts;

export interface GroupSource {
  fetchPart(group: number, part: number, signal: AbortSignal): Promise<PackedAnimation>;
  /** Called when a part has arrived, or has failed. */
  onArrival(): void;
  /** Called at the first failure of a part; its further failures are not reported. */
  onError(error: unknown): void;
}

/** Duration for which groups are prefetched, s. The next group is always fetched. */
const AHEAD_SECONDS = 6;
/** Maximum number of groups that are prefetched, because each frame searches them. */
const MAX_AHEAD = 200;
/** Maximum total size of groups in memory, bytes. The current and the next group are always kept. */
const MAX_BYTES = 160 << 20;
/**
 * Delay before a failed part is requested again, ms: four times as long after each further failure. The second constant
 * is the maximum number of attempts.
 */
const RETRY_MS = 5_000;
const MAX_TRIES = 4;

/** A part of a group: `content` after it has arrived, `abort` while it is in transit. */
interface Entry {
  readonly group: number;
  readonly part: number;
  content?: PackedAnimation;
  abort?: AbortController;
}

/**
 * Cache of the groups of a clip. Groups are fetched ahead, part by part. If the memory is full, parts that are not
 * needed soon are discarded, those fetched first before others.
 */
export class GroupCache {
  readonly #index: ClipIndex;
  readonly #source: GroupSource;
  readonly #entries = new Map<string, Entry>();
  readonly #failures = new BackOff<string>({ firstMs: RETRY_MS, factor: 4, maxTries: MAX_TRIES });
  #wanted: readonly (readonly [group: number, part: number])[] = [];
  #wantedFor = '';
  #isClosed = false;

  constructor(index: ClipIndex, source: GroupSource) {
    this.#index = index;
    this.#source = source;
  }

  /** Number of groups with a part in memory or in transit. */
  get held(): number {
    const held = [...this.#entries.values()].filter(({ content, abort }) => content ?? abort);
    return new Set(held.map(({ group }) => group).filter((group) => group !== STILL)).size;
  }

  /** Indices of the groups whose coarse part is in memory, in ascending order. */
  get loaded(): number[] {
    const coarse = [...this.#entries.values()].filter(({ part, content }) => part === 0 && content);
    const groups = coarse.map(({ group }) => group).filter((group) => group !== STILL);
    return groups.sort((a, b) => a - b);
  }

  /** Number of bytes of the clip file whose content is in memory. */
  get loadedBytes(): number {
    let sum = 0;
    for (const { group, part, content } of this.#entries.values()) {
      const { sceneBytes, motionBytes } = partsIn(this.#index, group)[part];
      if (content) sum += sceneBytes + motionBytes;
    }
    return sum;
  }

  get(group: number, part: number): PackedAnimation | undefined {
    return this.#entries.get(keyOf(group, part))?.content;
  }

  /** Returns whether the coarse part of a group is in memory, and that of the splats that never change. */
  canShow(group: number): boolean {
    return this.get(group, 0) !== undefined && (this.#index.still.length === 0 || this.get(STILL, 0) !== undefined);
  }

  /** Returns whether a part has failed and is not requested again yet. */
  isMissing(group: number, part: number): boolean {
    return this.#failures.isPaused(keyOf(group, part));
  }

  /** Fetches the coarse parts that the first frame needs. Rejects with the error of the download. */
  async first(group: number, signal: AbortSignal): Promise<void> {
    for (const own of this.#index.still.length > 0 ? [STILL, group] : [group]) {
      const content = await this.#source.fetchPart(own, 0, signal);
      this.#entries.set(keyOf(own, 0), { group: own, part: 0, content });
    }
  }

  /**
   * Sets the current group, and fetches the groups that follow it. `loops`: whether the first group follows the last.
   * `direction`: -1 if playback goes backward.
   */
  want(group: number, loops: boolean, direction: 1 | -1 = 1): void {
    const key = `${group} ${loops} ${direction}`;
    if (key !== this.#wantedFor) {
      this.#wantedFor = key;
      this.#wanted = this.#wantedFrom(group, loops, direction);
      // A seek to a group that is not loaded does not wait for a part that is needed later.
      const isUrgent = !this.get(group, 0) && !this.isMissing(group, 0);
      const needed = isUrgent
        ? this.#wanted.filter(([own, part]) => part === 0 && (own === group || own === STILL))
        : this.#wanted;
      for (const entry of this.#entries.values()) {
        if (!entry.abort || includes(needed, entry)) continue;
        entry.abort.abort();
        entry.abort = undefined;
      }
    }
    this.#next();
  }

  close(): void {
    this.#isClosed = true;
    for (const { abort } of this.#entries.values()) abort?.abort();
    this.#entries.clear();
  }

  /**
   * Returns the needed parts, the most urgent first. The coarse part of the next group has priority over the fine parts
   * of the current group. Parts that never change are always needed.
   */
  #wantedFrom(group: number, loops: boolean, direction: 1 | -1): (readonly [number, number])[] {
    const { groups, framesPerSecond } = this.#index;
    const ahead: number[] = [];
    let seconds = 0;
    const count = Math.min(groups.length, 1 + MAX_AHEAD);
    for (const next of indicesFrom(group, count, direction, groups.length, loops).slice(1)) {
      if (seconds >= AHEAD_SECONDS && ahead.length > 0) break;
      ahead.push(next);
      seconds += groups[next].frames / framesPerSecond;
    }
    const fine = (own: number): (readonly [number, number])[] =>
      partsIn(this.#index, own)
        .slice(1)
        .map((_, k) => [own, k + 1] as const);
    const [next, ...later] = ahead;
    return [
      ...(this.#index.still.length > 0 ? [[STILL, 0] as const] : []),
      [group, 0],
      ...(next === undefined ? [] : [[next, 0] as const]),
      ...fine(STILL),
      ...fine(group),
      ...(next === undefined ? [] : fine(next)),
      ...later.flatMap((own) => [[own, 0] as const, ...fine(own)]),
    ];
  }

  #next(): void {
    if (this.#isClosed) return;
    for (const { abort } of this.#entries.values()) if (abort) return;
    const due = this.#wanted.find(
      // The fine parts of a group are useless without its coarse part.
      ([group, part]) => !this.get(group, part) && !this.isMissing(group, part) && (part === 0 || this.get(group, 0)),
    );
    if (!due || !this.#makeRoom(due)) return;
    void this.#fetch(due);
  }

  /** Discards unneeded parts, oldest first, until a part fits. Returns false if the part does not fit and can wait. */
  #makeRoom([group, part]: readonly [number, number]): boolean {
    const needed = this.#bytesOf(group, part);
    const kept = [...this.#entries].filter(([, { content }]) => content);
    let sum = kept.reduce((total, [, { content }]) => total + bytesOf(content!), 0);
    for (const [key, entry] of kept) {
      if (sum + needed <= MAX_BYTES) return true;
      if (includes(this.#wanted, entry)) continue;
      sum -= bytesOf(entry.content!);
      this.#entries.delete(key);
    }
    return sum + needed <= MAX_BYTES || this.#isUrgent(group);
  }

  /** Returns whether a group is the current or the next one, or shared. */
  #isUrgent(group: number): boolean {
    const ahead = this.#wanted.filter(([own]) => own !== STILL).slice(0, 2);
    return group === STILL || ahead.some(([own]) => own === group);
  }

  #bytesOf(group: number, part: number): number {
    return clipPartBytes(partsIn(this.#index, group)[part]);
  }

  async #fetch([group, part]: readonly [number, number]): Promise<void> {
    const key = keyOf(group, part);
    const entry: Entry = this.#entries.get(key) ?? { group, part };
    const abort = new AbortController();
    entry.abort = abort;
    this.#entries.set(key, entry);
    try {
      const content = await this.#source.fetchPart(group, part, abort.signal);
      if (abort.signal.aborted || this.#isClosed) return;
      entry.content = content;
      this.#failures.succeed(key);
    } catch (error) {
      if (abort.signal.aborted || this.#isClosed) return;
      if (this.#failures.fail(key) === 1) this.#source.onError(error);
    }
    entry.abort = undefined;
    this.#next();
    this.#source.onArrival();
  }
}

const keyOf = (group: number, part: number): string => `${group} ${part}`;

const includes = (wanted: readonly (readonly [number, number])[], { group, part }: Entry): boolean =>
  wanted.some(([g, p]) => g === group && p === part);

const bytesOf = ({ bases, sh, codes, curves }: PackedAnimation): number =>
  bases.byteLength + sh.byteLength + codes.byteLength + curves.byteLength;
