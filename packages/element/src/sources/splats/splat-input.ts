import {
  GaussianSplatError,
  SPLAT_FILTERS,
  type FilterRule,
  type GaussianCloud,
  type Vector3,
} from '@gaussian-splat/core';
import {
  ARRAYS,
  checkUpdate,
  numbersOf,
  type ArrayName,
  type SplatArrays,
  type SplatUpdate,
} from '@gaussian-splat/formats/updates';
import type { ReactiveControllerHost } from 'lit';
import type { SceneLimits } from '../../loading/protocol.js';
import { follow, isFeed, type SplatFeed } from './follow.js';

/** Values of the property `splats`. */
export type Splats = SplatUpdate | GaussianCloud | SplatFeed;

/** All splats of a scene, in the arrays of the page or of the last message. */
export interface SplatState {
  readonly count: number;
  readonly arrays: Readonly<Partial<Record<ArrayName, Float32Array>>>;
  readonly shDegree: GaussianCloud['shDegree'];
  readonly raw: boolean;
  readonly rule: FilterRule;
  readonly origin: Vector3;
  /** Unit vector that points up, if a cloud declares it. */
  readonly up: Vector3 | undefined;
}

/** Values of an array that have changed since the last state was shown. */
export interface ChangedRange {
  readonly name: ArrayName;
  readonly first: number;
  readonly count: number;
}

/** Shows the states of a {@link SplatInput}. */
export interface SplatSink {
  /** Whether a state may be shown: a frame has been drawn since the last one. */
  readonly isReady: boolean;
  /**
   * Shows a state, whose arrays do not change before the promise is settled.
   * @param changed Ranges that differ from the last state that this sink has shown; undefined for all.
   */
  show(state: SplatState, changed: readonly ChangedRange[] | undefined): Promise<void>;
  /** Called when a value of the property, or a message, cannot be shown. The last state stays. */
  fail(error: unknown): void;
}

/** An element, or a child of it, with the property `splats`. */
type SplatsElement = ReactiveControllerHost & HTMLElement & { readonly splats?: Splats | null };

/** Methods of elements that show arrays. They are undefined before the first arrays are shown. */
export interface SplatMethods {
  /**
   * Replaces values of some splats that the property `splats` has set: those of each array that is passed, from splat
   * `first` on. The arrays of the page stay unchanged. Fulfills when the values are shown; off-screen it waits.
   * @returns Rejects with GaussianSplatError `argument/cloud` if the arrays do not match, or the range is outside of
   * the scene.
   */
  updateSplats?(first: number, arrays: SplatArrays): Promise<void>;
}

declare module '../../viewer/attributes.js' {
  interface FeatureMembers extends SplatMethods {}
}

const inputs = new WeakMap<HTMLElement, SplatInput>();

/** Settles the promise of an update: true if it was shown, false if a later scene has replaced it before. */
interface Waiter {
  readonly resolve: (isShown: boolean) => void;
  readonly reject: (error: unknown) => void;
}

/**
 * The newest splats of one element: those of its property `splats`, with the ranges that have changed since. A state
 * that arrives while another one is uploaded replaces any state that waits.
 */
export class SplatInput {
  readonly #element: SplatsElement;
  #given: Splats | null | undefined;
  #feed: AbortController | undefined;
  #state: SplatState | undefined;
  /** Names of the arrays that belong to this object, so that it may change them. */
  #own = new Set<ArrayName>();
  /** Whether the sink has not shown the scene of the state yet. */
  #isNew = false;
  #ranges: SplatUpdate[] = [];
  #waiters: Waiter[] = [];
  #isBusy = false;
  #sink: SplatSink | undefined;
  /** Limits of the scene, and of each message. */
  #limits: SceneLimits = {};
  /** Settles the promise of {@link first}. */
  #first: { readonly resolve: (state: SplatState) => void; readonly reject: (error: unknown) => void } | undefined;

  private constructor(element: SplatsElement) {
    this.#element = element;
    element.addController({ hostUpdated: () => void ((this.#sink ?? this.#first) && this.#read()) });
    Object.assign(element, {
      updateSplats: async (first: number, arrays: SplatArrays) => void (await this.add({ ...arrays, first })),
    });
  }

  static of(element: HTMLElement): SplatInput {
    const input = inputs.get(element) ?? new SplatInput(element as SplatsElement);
    inputs.set(element, input);
    return input;
  }

  /** Fulfills with the newest state, as soon as there is one. Rejects if there will be none, or with the signal's reason. */
  async first(signal: AbortSignal, limits: SceneLimits = {}): Promise<SplatState> {
    this.#limits = limits;
    try {
      return await new Promise((resolve, reject) => {
        this.#first = { resolve, reject };
        signal.addEventListener('abort', () => reject(signal.reason as Error), { once: true });
        this.#read();
        if (this.#state) resolve(this.#state);
      });
    } finally {
      this.#first = undefined;
      if (signal.aborted) this.#release();
    }
  }

  /** Shows states with a sink from now on, which shows `state` already. */
  attach(sink: SplatSink, state: SplatState): void {
    this.#sink = sink;
    this.#isNew = state !== this.#state;
    if (!this.#isNew && this.#ranges.length === 0) this.#settle(true);
    this.#read();
  }

  /** Shows no states with a sink any more. */
  detach(sink: SplatSink): void {
    if (this.#sink !== sink) return;
    this.#sink = undefined;
    this.#release();
  }

  /** Forgets the state of an element that was removed, or has no splats any more, and cancels its stream. */
  #release(): void {
    if (this.#element.isConnected && this.#element.splats) return;
    this.#feed?.abort();
    [this.#feed, this.#given, this.#state, this.#ranges] = [undefined, undefined, undefined, []];
    this.#settle(false);
  }

  #settle(isShown: boolean): void {
    for (const { resolve } of this.#waiters.splice(0)) resolve(isShown);
  }

  /** Reads the property, if the page has set another value. */
  #read(): void {
    const { splats } = this.#element;
    if (splats === this.#given) return;
    this.#given = splats;
    this.#feed?.abort();
    this.#feed = undefined;
    if (!splats) return;
    const fail = (error: unknown): void => this.#fail(error);
    if (isFeed(splats)) {
      this.#feed = new AbortController();
      const { maxBytes } = this.#limits;
      follow(splats, { add: (update) => this.add(update), fail, maxBytes }, this.#feed.signal);
    } else this.add({ ...splats, first: undefined }).catch(fail);
  }

  /**
   * Adds an update. Fulfills with true when it is uploaded, and with false if a later scene has replaced it before.
   * Rejects with GaussianSplatError `argument/cloud` or `out-of-memory/*`.
   */
  async add(update: SplatUpdate & Partial<GaussianCloud>): Promise<boolean> {
    if (update.first === undefined) this.#replace(update);
    else this.#ranges.push(this.#checked(update));
    const shown = new Promise<boolean>((resolve, reject) => this.#waiters.push({ resolve, reject }));
    this.#first?.resolve(this.#state!);
    this.proceed();
    return shown;
  }

  /** Shows the newest state, if the sink is ready. */
  proceed(): void {
    if (!this.#isBusy) void this.#showAll();
  }

  #replace(update: SplatUpdate & Partial<GaussianCloud>): void {
    const { count, shDegree } = checkUpdate(update);
    const { maxSplats = Infinity } = this.#limits;
    if (count > maxSplats) throw tooMany(maxSplats, count);
    const { raw = false, filter = 'classic', antialiased, filterVariance, origin = [0, 0, 0], hints } = update;
    const rule = antialiased === undefined ? SPLAT_FILTERS[filter] : { antialiased, filterVariance };
    const arrays = Object.fromEntries(ARRAYS.flatMap((name) => (update[name] ? [[name, update[name]]] : [])));
    this.#state = { count, shDegree, arrays, raw, rule, origin, up: hints?.up };
    this.#own.clear();
    this.#isNew = true;
    this.#ranges = [];
    this.#settle(false);
  }

  #checked(update: SplatUpdate): SplatUpdate {
    const state = this.#state;
    const { first = 0 } = update;
    const known = { ...update, shDegree: update.shDegree ?? (update.sh && state?.shDegree) };
    const { count } = checkUpdate(known);
    const missing = ARRAYS.find((name) => update[name] && !state?.arrays[name]);
    if (!state || missing || (update.sh && known.shDegree !== state.shDegree))
      throw unfit(
        missing ?? 'sh',
        state ? `an array that the scene has, of degree ${state.shDegree}` : 'a scene',
        'none',
      );
    if (!(Number.isInteger(first) && first >= 0 && first + count <= state.count))
      throw unfit('first', `a range within ${state.count} splats`, `${first} to ${first + count}`);
    if (update.raw !== undefined && update.raw !== state.raw)
      throw unfit('raw', `${state.raw}, as in the scene`, `${update.raw}`);
    return update;
  }

  async #showAll(): Promise<void> {
    this.#isBusy = true;
    while (this.#sink?.isReady && (this.#isNew || this.#ranges.length > 0)) {
      const [sink, isNew, waiters] = [this.#sink, this.#isNew, this.#waiters];
      const changed = this.#apply(this.#ranges);
      [this.#isNew, this.#ranges, this.#waiters] = [false, [], []];
      try {
        await sink.show(this.#state!, isNew ? undefined : changed);
        for (const { resolve } of waiters) resolve(true);
      } catch (error) {
        for (const { reject } of waiters) reject(error);
      }
    }
    this.#isBusy = false;
  }

  /** Writes ranges to the state. The arrays of the page are copied before the first change. */
  #apply(ranges: readonly SplatUpdate[]): ChangedRange[] {
    return ranges.flatMap((range) =>
      ARRAYS.flatMap((name) => {
        const values = range[name];
        if (!values) return [];
        const { arrays, shDegree } = this.#state!;
        if (!this.#own.has(name)) {
          this.#state = { ...this.#state!, arrays: { ...arrays, [name]: arrays[name]!.slice() } };
          this.#own.add(name);
        }
        const stride = numbersOf(name, shDegree);
        this.#state!.arrays[name]!.set(values, stride * range.first!);
        return [{ name, first: range.first!, count: values.length / stride }];
      }),
    );
  }

  #fail(error: unknown): void {
    if (this.#first) this.#first.reject(error);
    else this.#sink?.fail(error);
  }
}

const tooMany = (max: number, count: number): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where: 'splats',
    expected: `at most ${max} splats, the sceneLimits of the page`,
    found: `${count}`,
    remedy: 'show fewer splats, or raise sceneLimits.maxSplats',
  });

const unfit = (name: string, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('argument/cloud', {
    where: `updateSplats: ${name}`,
    expected,
    found,
    remedy: 'update splats of the current scene, or assign all of them to the property splats',
  });
