import type { Matrix4, Vector3 } from '@gaussian-splat/core';
import { ReactiveElement, type PropertyDeclarations, type PropertyValues } from 'lit';
import { declarations, type Attribute } from '../attributes.js';
import { readAttribute } from '../camera/grammar.js';
import { notPlayed } from '../controllers/playback-controller.js';
import type { ElementError } from '../errors.js';
import { adopt } from './adopt.js';
import type { MESH_ATTRIBUTES, PropertiesOf } from './attributes.js';
import type { Part } from './part.js';
import { matrixOf, readMatrix } from './placing.js';

type Written = string | number | ArrayLike<number | string> | null | undefined;

/** Numbers of a property, as an attribute would have them. */
const written = (value: Written, unit = ''): string | number | null | undefined =>
  typeof value === 'object' && value !== null ? Array.from(value, (each) => `${each}${unit}`).join(' ') : value;

/** Events of a child of `<gaussian-splat>`. None of them bubbles. */
export interface ChildEventMap {
  /** It is shown. */
  load: CustomEvent<{ readonly url: string }>;
  /** Bytes have arrived. */
  progress: ProgressEvent;
  /** It cannot be shown; the same object as its property `error`. What else there is stays. */
  error: CustomEvent<ElementError>;
}

/** What all children have: a source, a place, and what is known of it. */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export abstract class SplatChild extends ReactiveElement {
  /** What stands for it among all that its `<gaussian-splat>` shows. @internal */
  abstract readonly content: Part;
  /** @internal */
  protected abstract readonly table: Readonly<Record<string, Attribute<unknown, unknown>>>;
  readonly #warned = new Set<string>();
  #isDriven = false;

  /**
   * All of its place at once, above `position`, `rotation` and `scale`: 16 numbers of an affine matrix, row after row, or a `DOMMatrix`; from its own frame, y up, to viewer space. null for none.
   */
  declare matrix: ArrayLike<number> | DOMMatrixReadOnly | null;

  /** True while it is shown. */
  get loaded(): boolean {
    return this.content.state === 'ready';
  }

  /** Fulfils, and never rejects, when there is nothing left to wait for: it is shown ({@link loaded}), it cannot be ({@link error}), or it has no source. */
  get ready(): Promise<void> {
    return this.updateComplete.then(() => this.content.settled);
  }

  /** Why it is not shown, or null. */
  get error(): ElementError | null {
    return this.content.error;
  }

  /** Share of the loading that is done, 0..1. */
  get progress(): number {
    return this.loaded ? 1 : (this.content.progress ?? 0);
  }

  /** Fetches it again, as if `src` had just been set. */
  load(): void {
    this.content.reload();
  }

  /** Seconds into what moves; setting it seeks, and gives it a clock of its own. What has none follows that of its `<gaussian-splat>`. */
  get currentTime(): number {
    return this.content.playback.currentTime;
  }

  set currentTime(seconds: number) {
    if (seconds === null || seconds === undefined) return;
    this.#drive();
    this.content.playback.currentTime = seconds;
  }

  /** Seconds; NaN while nothing moves, Infinity for what has no end. */
  get duration(): number {
    return this.content.duration;
  }

  /** Whether its time stands still. */
  get paused(): boolean {
    return this.content.playback.paused;
  }

  /** Speed of its own clock; 1 is that of the clock. */
  get playbackRate(): number {
    return this.content.playback.playbackRate;
  }

  set playbackRate(rate: number) {
    if (rate === null || rate === undefined) return;
    this.#drive();
    this.content.playback.playbackRate = rate;
  }

  /**
   * Lets its time run, on a clock of its own, once it is there.
   * @returns rejects with a `NotSupportedError` where nothing moves, and with an `AbortError` if `pause()` or another `src` comes before it does.
   */
  async play(): Promise<void> {
    this.#drive();
    const { playback } = this.content;
    const { pauses } = playback;
    await this.updateComplete;
    if (playback.pauses !== pauses) throw notPlayed();
    await playback.waitFor(this.ready);
    if (!playback.canPlay) throw new DOMException('There is nothing that moves', 'NotSupportedError');
    playback.play();
  }

  /** Lets its time stand still. */
  pause(): void {
    this.#drive();
    this.content.playback.pause();
  }

  /** From now on it has a clock of its own. */
  #drive(): void {
    this.#isDriven = true;
  }

  /** It has a clock of its own: it plays by itself, starts again by itself, or a script has moved its time. @internal */
  get hasOwnClock(): boolean {
    return this.autoplay || this.loop || this.#isDriven;
  }

  /** Its place in viewer space. @internal */
  get placed(): Matrix4 {
    if (this.matrix !== null && this.matrix !== undefined) {
      const matrix = readMatrix(this.matrix);
      if (matrix) return matrix;
      this.warn(`<${this.localName}> matrix: expected 16 numbers, the last row 0 0 0 1, or a DOMMatrix; the place is used.`);
    }
    return matrixOf({
      position: this.read<Vector3>('position', written(this.position)),
      rotation: this.read<Vector3>('rotation', written(this.rotation, 'rad')),
      scale: this.read<Vector3>('scale', written(this.scale)),
    });
  }

  /** An attribute by its grammar; a malformed one counts as absent, with a warning. @internal */
  protected read<T>(name: string, value: Written): T {
    const grammar = this.table[name].grammar!;
    return readAttribute(name, written(value), grammar, (sentence) =>
      this.warn(sentence.replace('<gaussian-splat>', `<${this.localName}>`)),
    ) as T;
  }

  /** @internal */
  warn(sentence: string): void {
    if (this.#warned.has(sentence)) return;
    this.#warned.add(sentence);
    console.warn(sentence);
  }

  override connectedCallback(): void {
    super.connectedCallback();
    adopt(this);
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.content.attach(null);
  }

  /** It shows nothing of its own. */
  protected override createRenderRoot(): HTMLElement {
    return this;
  }

  protected override updated(_changed: PropertyValues): void {
    this.content.update();
  }
}

// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export interface SplatChild extends Omit<PropertiesOf<typeof MESH_ATTRIBUTES>, 'src'> {
  addEventListener<K extends keyof ChildEventMap>(
    type: K,
    listener: (this: this, event: ChildEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions,
  ): void;
}

/** What Lit is told of a child's properties. */
export const childDeclarations = (
  table: Readonly<Record<string, Attribute<unknown, unknown>>>,
): PropertyDeclarations => ({
  ...declarations(table),
  matrix: { attribute: false },
  hidden: { type: Boolean, reflect: true },
  // Accessors: named here so that what a page sets before the element is defined reaches them.
  currentTime: { attribute: false, noAccessor: true },
  playbackRate: { attribute: false, noAccessor: true },
});
