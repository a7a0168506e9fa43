import { multiply, type Camera, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { ReactiveElement, type PropertyDeclarations } from 'lit';
import type { Box } from '@gaussian-splat/renderer';
import { declarations, type Attribute, type Attributes } from '../attributes.js';
import { readAttribute } from '../camera/grammar.js';
import { notPlayed } from '../controllers/playback-controller.js';
import type { ElementError } from '../errors.js';
import type { GaussianSplatEventMap } from '../events.js';
import type { LiveState } from '../live/live-model.js';
import { frameOf } from '../camera/settings.js';
import type { Source } from '../stage-host.js';
import type { MESH_ATTRIBUTES, PropertiesOf } from './attributes.js';
import type { Member } from '../member.js';
import { SourceEntry, type EntryStage, type SourceOwner } from '../source-entry.js';
import { cameraInScene, isSolid, matrixOf, matrixOfFrame, readMatrix, sceneToWorld, transposed } from './placing.js';
import { Lazy } from '../lazy.js';
import type { Interaction, InteractionHost, ScenePointerEvent } from './interaction.js';

type Written = string | number | ArrayLike<number | string> | null | undefined;

/** Numbers of a property, as an attribute would have them. */
const written = (value: Written, unit = ''): string | number | null | undefined =>
  typeof value === 'object' && value !== null ? Array.from(value, (each) => `${each}${unit}`).join(' ') : value;

/** Where a child is, and how it is drawn. */
export interface ChildPlace {
  /** From its own frame, once that is turned so that y is up, to viewer space. */
  readonly placed: Matrix4;
  readonly up: Vector3 | undefined;
  readonly opacity: number;
  readonly crop: Box | undefined;
  readonly hidden: boolean;
}

/** As glTF has it. */
const UP: Vector3 = [0, 1, 0];
const NO_VALUES: Omit<LiveState, 'timeSeconds'> = { pose: undefined, controls: {}, pictures: {} };

/** Events of a child of `<gaussian-splat>`, with the meanings that they have there. Only those of pointers bubble. */
export type ChildEventMap = Record<
  'click' | 'pointerover' | 'pointerout' | 'pointerenter' | 'pointerleave',
  ScenePointerEvent
> &
  Omit<
    GaussianSplatEventMap,
    | 'camera-change'
    | 'poster-dismissed'
    | 'shader-error'
    | 'model-visibility'
    | 'contextlost'
    | 'contextrestored'
    | 'loadeddata'
    | 'canplay'
  >;

/** The properties that a page may set, for the typings of frameworks. */
export type SettableOf<Table> = Partial<
  PropertiesOf<Table> & Pick<SplatChild, 'matrix' | 'currentTime' | 'playbackRate'> & { hidden: boolean }
>;

/** What all children have: a source, a place, and what is known of it. */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export abstract class SplatChild extends ReactiveElement implements SourceOwner {
  /** What stands for it among all that its `<gaussian-splat>` shows. @internal */
  readonly holder = new SourceEntry(this);
  /** @internal */
  protected abstract readonly table: Readonly<Record<string, Attribute<unknown, unknown>>>;
  readonly #warned = new Set<string>();
  #isDriven = false;
  #place: ChildPlace | undefined;

  constructor() {
    super();
    // Boolean properties start as booleans: frameworks look at them to decide what a bare attribute means.
    Object.assign(this, { autoplay: false, loop: false, interactive: false, hidden: false });
  }

  /**
   * All of its place at once, above `position`, `rotation` and `scale`: 16 numbers of an affine matrix, row after row, or a `DOMMatrix`; from its own frame, y up, to viewer space. null for none.
   */
  declare matrix: ArrayLike<number> | DOMMatrixReadOnly | null;

  /** True while it is shown. */
  get loaded(): boolean {
    return this.holder.state === 'ready';
  }

  /** Fulfils, and never rejects, when there is nothing left to wait for: it is shown ({@link loaded}), it cannot be ({@link error}), or it has no source. */
  get ready(): Promise<void> {
    return this.updateComplete.then(() => this.holder.scene.settled);
  }

  /** Why it is not shown, or null. */
  get error(): ElementError | null {
    return this.holder.error;
  }

  /** Share of the loading that is done, 0..1. */
  get progress(): number {
    return this.loaded ? 1 : (this.holder.progress ?? 0);
  }

  /** Fetches it again, as if `src` had just been set. */
  load(): void {
    this.holder.reload();
  }

  /** Seconds into what moves; setting it seeks, and gives it a clock of its own. What has none follows that of its `<gaussian-splat>`. */
  get currentTime(): number {
    return this.holder.playback.currentTime;
  }

  set currentTime(seconds: number) {
    if (seconds === null || seconds === undefined) return;
    this.#drive();
    this.holder.playback.currentTime = seconds;
  }

  /** Seconds; NaN while nothing moves, Infinity for what has no end. */
  get duration(): number {
    return this.holder.duration;
  }

  /** Whether its time stands still. */
  get paused(): boolean {
    return this.holder.playback.paused;
  }

  /** Speed of its own clock; 1 is that of the clock. */
  get playbackRate(): number {
    return this.holder.playback.playbackRate;
  }

  set playbackRate(rate: number) {
    if (rate === null || rate === undefined) return;
    this.#drive();
    this.holder.playback.playbackRate = rate;
  }

  /**
   * Lets its time run, on a clock of its own, once it is there.
   * @returns rejects with a `NotSupportedError` where nothing moves, and with an `AbortError` if `pause()` or another `src` comes before it does.
   */
  async play(): Promise<void> {
    this.#drive();
    const { playback } = this.holder;
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
    this.holder.playback.pause();
  }

  /** From now on it has a clock of its own. */
  #drive(): void {
    this.#isDriven = true;
    this.holder.hasBegun = true;
  }

  /** It has a clock of its own: it plays by itself, starts again by itself, or a script has moved its time. @internal */
  get hasOwnClock(): boolean {
    return this.autoplay || this.loop || this.#isDriven;
  }

  /** @internal */
  abstract get source(): Source;

  /** @internal */
  get liveValues(): Omit<LiveState, 'timeSeconds'> {
    return NO_VALUES;
  }

  /** @internal */
  get element(): this {
    return this;
  }

  /** @internal */
  get overrides(): Partial<Attributes> {
    const { autoplay, loop } = this;
    const own = { autoplay, loop, time: null };
    return this.crossorigin === null ? own : { ...own, crossorigin: this.read('crossorigin', this.crossorigin) };
  }

  /** @internal */
  place({ scene, placement }: Member, { frame }: EntryStage): void {
    const { placed, up, opacity, crop, hidden } = this.#placed;
    placement.visible = !hidden && isSolid(placed);
    if (placement.visible) placement.sceneToWorld = sceneToWorld(frame, placed, frameOf({ up }, scene.bounds));
    placement.opacity = opacity;
    placement.crop = crop;
  }

  /** @internal */
  seenFrom(camera: Camera, member: Member | undefined, { frame }: EntryStage): Camera {
    const { placed, up } = this.#placed;
    // Where it will stand, before anything is known of it.
    const matrix = member?.placement.sceneToWorld ?? sceneToWorld(frame, placed, frameOf({ up }, {}));
    return isSolid(matrix) ? cameraInScene(camera, matrix) : camera;
  }

  /** From the frame of its own children, y up, to the world. @internal */
  frameToWorld({ scene, placement }: Member): Matrix4 {
    const own = transposed(matrixOfFrame(frameOf({ up: this.#placed.up }, scene.bounds)));
    return placement.sceneToWorld ? multiply(placement.sceneToWorld, own) : own;
  }

  get #placed(): ChildPlace {
    return (this.#place ??= this.readPlace());
  }

  /** @internal */
  protected readPlace(): ChildPlace {
    return { placed: this.#readPlaced(), up: UP, opacity: 1, crop: undefined, hidden: Boolean(this.hidden) };
  }

  protected override willUpdate(): void {
    this.#place = undefined;
  }

  /** Its place in viewer space. */
  #readPlaced(): Matrix4 {
    if (this.matrix !== null && this.matrix !== undefined) {
      const matrix = readMatrix(this.matrix);
      if (matrix) return matrix;
      this.warn(
        `<${this.localName}> matrix: expected 16 numbers, the last row 0 0 0 1, or a DOMMatrix; the place is used.`,
      );
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
    // With its element around it, it stays what it is, and goes when that does.
    if (this.parentElement !== this.holder.parent) this.holder.attach(null);
  }

  /** It shows nothing of its own. */
  protected override createRenderRoot(): HTMLElement {
    return this;
  }

  protected override updated(): void {
    this.holder.update();
    this.holder.requestFrame();
    interactionChanged(this);
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

/** What children ask of the element around them. */
export type ChildStage = EntryStage & InteractionHost;

/** The stages of elements that have children. */
export const stages = new WeakMap<Element, ChildStage>();

const interactions = new WeakMap<Element, Lazy<Interaction>>();

/** Lets visitors click the children of an element, once one of them wants it. */
function interactionChanged(child: SplatChild): void {
  const parent = child.parentElement;
  const stage = parent && stages.get(parent);
  if (!stage) return;
  let code = interactions.get(parent);
  if (code === undefined) {
    if (!child.interactive) return;
    code = new Lazy('the code of clicks on scenes', async () => {
      const { Interaction } = await import('./interaction.js');
      return new Interaction(stage);
    });
    interactions.set(parent, code);
  }
  if (code.value) code.value.update();
  else code.want(({ message }) => child.warn(message));
}

/** Gives a child to its element. One that has not looked at its children yet asks for them itself. */
export function adopt(child: SplatChild): void {
  const { parentElement } = child;
  // Its first update may have come before its element looked at its children.
  interactionChanged(child);
  child.holder.attach((parentElement && stages.get(parentElement)) ?? null);
}
