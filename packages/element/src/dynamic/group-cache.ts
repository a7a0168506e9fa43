import { BackOff } from '@gaussian-splat/core/fetch';
import type { ClipIndex } from '@gaussian-splat/formats';
import type { PackedAnimation } from '@gaussian-splat/renderer/tools';

export interface GroupSource {
  fetchPart(group: number, part: number, signal: AbortSignal): Promise<PackedAnimation>;
  /** Called when a part has arrived. */
  onArrival(): void;
  /** Called once when a part is unavailable. */
  onError(error: unknown): void;
}

/** Prefetch time of groups; the next one is always fetched. */
const AHEAD_SECONDS = 6;
/** Maximum total size of groups in memory; the current and the next one are always kept. */
const MAX_BYTES = 160 << 20;
/**
 * Milliseconds before a failed part is requested again, four times as many after each further failure, and the maximum
 * number of attempts.
 */
const RETRY_MS = 5_000;
const MAX_TRIES = 4;

/** State of a part. */
interface Entry {
  readonly group: number;
  readonly part: number;
  content?: PackedAnimation;
  abort?: AbortController;
}

/** Groups of a clip in memory: fetched ahead part by part, and discarded if the memory is full, past ones first. */
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

  /** Number of groups with parts in memory or in transit. */
  get held(): number {
    return new Set(
      [...this.#entries.values()].filter(({ content, abort }) => content ?? abort).map(({ group }) => group),
    ).size;
  }

  get(group: number, part: number): PackedAnimation | undefined {
    return this.#entries.get(keyOf(group, part))?.content;
  }

  /** Whether a part has failed, until it is requested again. */
  isMissing(group: number, part: number): boolean {
    return this.#failures.isPaused(keyOf(group, part));
  }

  /** Fetches the parts for the first frame. Rejects with the thrown error. */
  async first(group: number, signal: AbortSignal): Promise<void> {
    const content = await this.#source.fetchPart(group, 0, signal);
    this.#entries.set(keyOf(group, 0), { group, part: 0, content });
  }

  /** Sets the current group. */
  want(group: number, loops: boolean): void {
    const key = `${group} ${loops}`;
    if (key !== this.#wantedFor) {
      this.#wantedFor = key;
      this.#wanted = this.#wantedFrom(group, loops);
      for (const entry of this.#entries.values()) {
        if (!entry.abort || this.#isWanted(entry)) continue;
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

  /** A coarse version of the next group has priority over a fine one of the current group. */
  #wantedFrom(group: number, loops: boolean): (readonly [number, number])[] {
    const { groups, framesPerSecond } = this.#index;
    const ahead: number[] = [];
    let seconds = 0;
    for (let k = 1; k < groups.length && (seconds < AHEAD_SECONDS || ahead.length === 0); k++) {
      const next = group + k;
      if (next >= groups.length && !loops) break;
      ahead.push(next % groups.length);
      seconds += groups[next % groups.length].frames / framesPerSecond;
    }
    const fine = (own: number): (readonly [number, number])[] =>
      groups[own].parts.slice(1).map((_, k) => [own, k + 1] as const);
    const [next, ...later] = ahead;
    return [
      [group, 0],
      ...(next === undefined ? [] : [[next, 0] as const]),
      ...fine(group),
      ...(next === undefined ? [] : fine(next)),
      ...later.flatMap((own) => [[own, 0] as const, ...fine(own)]),
    ];
  }

  #isWanted = ({ group, part }: Entry): boolean => this.#wanted.some(([g, p]) => g === group && p === part);

  #next(): void {
    if (this.#isClosed) return;
    for (const { abort } of this.#entries.values()) if (abort) return;
    const due = this.#wanted.find(
      // Refinements of a group are useless without its coarse part.
      ([group, part]) => !this.get(group, part) && !this.isMissing(group, part) && (part === 0 || this.get(group, 0)),
    );
    if (!due || !this.#makeRoom(due)) return;
    void this.#fetch(due);
  }

  /** Discards unneeded parts, oldest first, until a part fits. False if it does not fit and can wait. */
  #makeRoom([group, part]: readonly [number, number]): boolean {
    const needed = this.#bytesOf(group, part);
    const kept = [...this.#entries].filter(([, { content }]) => content);
    let sum = kept.reduce((total, [, { content }]) => total + bytesOf(content!), 0);
    for (const [key, entry] of kept) {
      if (sum + needed <= MAX_BYTES) return true;
      if (this.#isWanted(entry)) continue;
      sum -= bytesOf(entry.content!);
      this.#entries.delete(key);
    }
    return sum + needed <= MAX_BYTES || this.#wanted.slice(0, 2).some(([own]) => own === group);
  }

  #bytesOf(group: number, part: number): number {
    const { splats, planes } = this.#index.groups[group].parts[part];
    return splats * (56 + 2 * planes);
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

const bytesOf = ({ bases, sh, codes, curves }: PackedAnimation): number =>
  bases.byteLength + sh.byteLength + codes.byteLength + curves.byteLength;
