import { Lazy, multiply, type Camera, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { ReactiveElement, type PropertyDeclarations } from 'lit';
import type { Box } from '@gaussian-splat/renderer';
import type { AttributeTable, PropertiesOf } from '../../viewer/attribute.js';
import { declarations, type Attributes } from '../../viewer/attributes.js';
import { readAttribute } from '../../viewer/camera/grammar.js';
import type { ElementError } from '../../viewer/errors.js';
import type { GaussianSplatEventMap } from '../../viewer/events.js';
import type { DynamicState } from '../../sources/generator/dynamic-model.js';
import { frameOf } from '../../viewer/camera/settings.js';
import type { Source } from '../../viewer/element-host.js';
import { CLOCK_ATTRIBUTES, type MESH_ATTRIBUTES } from './attributes.js';
import type { Viewer } from '../../viewer/viewer.js';
import type { WorldEntry } from '../../viewer/world-entry.js';
import { SourceEntry, type EntryCore, type SourceOwner } from '../../viewer/source-entry.js';
import {
  cameraInScene,
  isSolid,
  matrixOf,
  matrixOfFrame,
  readMatrix,
  sceneToWorld,
  transposed,
} from '../../viewer/camera/placing.js';
import type { Interaction, ScenePointerEvent } from './interaction.js';

type Written = string | number | ArrayLike<number | string> | null | undefined;

/**
 * Returns the value of a property in the format of an attribute: a list becomes text, with a unit after each number.
 * Other values are returned unchanged.
 */
const written = (value: Written, unit = ''): string | number | null | undefined =>
  typeof value === 'object' && value !== null ? Array.from(value, (each) => `${each}${unit}`).join(' ') : value;

/** Transform and drawing options of a child, from its attributes. */
export interface ChildPlace {
  /** Transform to viewer space, from the child's own coordinates after these were rotated so that y is up. */
  readonly placed: Matrix4;
  readonly up: Vector3 | undefined;
  readonly opacity: number;
  readonly crop: Box | undefined;
  readonly hidden: boolean;
}

/** Up direction of glTF. */
const UP: Vector3 = [0, 1, 0];
const NO_VALUES: Omit<DynamicState, 'timeSeconds'> = { pose: undefined, controls: {}, images: {} };

/** Events of a child of `<gaussian-splat>`, with the same meanings as on that element. Only pointer events bubble. */
export type ChildEventMap = Record<
  'click' | 'pointerover' | 'pointerout' | 'pointerenter' | 'pointerleave',
  ScenePointerEvent
> &
  Pick<
    GaussianSplatEventMap,
    | 'load'
    | 'progress'
    | 'preview'
    | 'error'
    | 'generator-error'
    | 'inputs-change'
    | 'generator-memory'
    | 'generator-fallback'
    | 'play'
    | 'playing'
    | 'waiting'
    | 'pause'
    | 'timeupdate'
    | 'seeking'
    | 'seeked'
    | 'ended'
    | 'ratechange'
    | 'durationchange'
    | 'loadedmetadata'
    | 'loadstart'
    | 'emptied'
  >;

/** Properties of a child that a page may set, for the types of frameworks. */
export type SettableOf<Table> = Partial<
  PropertiesOf<Table> & Pick<SplatChild, 'matrix' | 'currentTime' | 'playbackRate'> & { hidden: boolean }
>;

/** Base class of the children `<splat-scene>` and `<splat-mesh>`: a source with a transform and a loading state. */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export abstract class SplatChild extends ReactiveElement implements SourceOwner {
  /** The entry of this child in the list of sources of its `<gaussian-splat>`. @internal */
  readonly entry = new SourceEntry(this);
  /** @internal */
  protected abstract readonly table: AttributeTable;
  readonly #warned = new Set<string>();
  #isDriven = false;
  #place: ChildPlace | undefined;

  constructor() {
    super();
    // Boolean properties are initialized, because frameworks use their type to interpret a bare attribute.
    for (const name of [...CLOCK_ATTRIBUTES, 'interactive', 'hidden'] as const) this[name] = false;
  }

  /**
   * Complete transform of the child, from its own coordinates (y up) to viewer space. It overrides `position`,
   * `rotation` and `scale`. The value is a row-major affine matrix of 16 numbers, a `DOMMatrix`, or null for none.
   */
  declare matrix: ArrayLike<number> | DOMMatrixReadOnly | null;

  /** Whether the child is loaded and shown. */
  get loaded(): boolean {
    return this.entry.scene.state === 'ready';
  }

  /** Resolves when the child is shown ({@link loaded}), has failed ({@link error}), or has no source. Never rejects. */
  get ready(): Promise<void> {
    return this.updateComplete.then(() => this.entry.scene.settled);
  }

  /** The error for which the child is not shown; null without an error. */
  get error(): ElementError | null {
    return this.entry.scene.error;
  }

  /** Loading progress of the child, 0..1. */
  get progress(): number {
    return this.loaded ? 1 : (this.entry.progress ?? 0);
  }

  /** Loads the child again, as if `src` had just been set. */
  load(): void {
    this.entry.reload();
  }

  /**
   * Playback position in seconds. Setting it seeks, and gives the child its own clock. Children without their own clock
   * follow that of their `<gaussian-splat>`.
   */
  get currentTime(): number {
    return this.entry.playback.currentTime;
  }

  set currentTime(seconds: number) {
    if (seconds === null || seconds === undefined) return;
    this.#drive();
    this.entry.seek(seconds);
  }

  /** Duration in seconds; NaN if nothing is animated, Infinity if the animation has no end. */
  get duration(): number {
    return this.entry.duration;
  }

  /** Whether playback is paused. */
  get paused(): boolean {
    return this.entry.playback.paused;
  }

  /** Speed of the child's own clock; 1 is real time. Setting it gives the child its own clock. */
  get playbackRate(): number {
    return this.entry.playback.playbackRate;
  }

  set playbackRate(rate: number) {
    if (rate === null || rate === undefined) return;
    this.#drive();
    this.entry.playback.playbackRate = rate;
  }

  /**
   * Starts playback on the child's own clock when the child is loaded.
   * @returns Rejects with a `NotSupportedError` if nothing is animated, and with an `AbortError` if `pause()` is called
   * or another `src` is set first.
   */
  play(): Promise<void> {
    this.#drive();
    return this.entry.playback.playWhenReady(this.entry.requested(), () => this.ready);
  }

  /** Pauses playback at the frame that is shown, and gives the child its own clock. */
  pause(): void {
    this.#drive();
    this.entry.playback.pause();
  }

  /** Gives the child its own clock, which continues at the time, the speed and the state of the clock before. */
  #drive(): void {
    const { playback: before, ownClock } = this.entry;
    this.#isDriven = true;
    this.entry.begin();
    if (before === ownClock || !ownClock.canPlay) return;
    ownClock.playbackRate = before.playbackRate;
    if (before.currentTime !== ownClock.currentTime) ownClock.currentTime = before.currentTime;
    // The animation of this child may have ended earlier than that of others.
    if (!before.paused && ownClock.currentTime < ownClock.duration) ownClock.play();
  }

  /**
   * Whether the child has its own clock: it has one of {@link CLOCK_ATTRIBUTES}, or a script has controlled its playback.
   * @internal
   */
  get hasOwnClock(): boolean {
    return this.#isDriven || CLOCK_ATTRIBUTES.some((name) => this[name]);
  }

  /** @internal */
  abstract get source(): Source;

  /** @internal */
  get ownUp(): Vector3 | undefined {
    return this.#placed.up;
  }

  /** @internal */
  get dynamicValues(): Omit<DynamicState, 'timeSeconds'> {
    return NO_VALUES;
  }

  /** @internal */
  get element(): this {
    return this;
  }

  /** @internal */
  get overrides(): Partial<Attributes> {
    const own = { ...Object.fromEntries(CLOCK_ATTRIBUTES.map((name) => [name, this[name]])), time: null };
    return this.crossorigin === null ? own : { ...own, crossorigin: this.read('crossorigin', this.crossorigin) };
  }

  /** @internal */
  place({ scene, placement }: WorldEntry, { frame }: EntryCore): void {
    const { placed, up, opacity, crop, hidden } = this.#placed;
    placement.visible = !hidden && isSolid(placed);
    if (placement.visible) placement.sceneToWorld = sceneToWorld(frame, placed, frameOf({ up }, scene.bounds));
    placement.opacity = opacity;
    placement.crop = crop;
  }

  /** @internal */
  seenFrom(camera: Camera, member: WorldEntry | undefined, { frame }: EntryCore): Camera {
    const { placed, up } = this.#placed;
    // Before the child is loaded, its transform is computed without its bounds.
    const matrix = member?.placement.sceneToWorld ?? sceneToWorld(frame, placed, frameOf({ up }, {}));
    return isSolid(matrix) ? cameraInScene(camera, matrix) : camera;
  }

  /** Returns the matrix from the coordinates of nested children (y up) to the world. @internal */
  frameToWorld({ scene, placement }: WorldEntry): Matrix4 {
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

  /**
   * Returns the transform of the child in viewer space: `matrix`, or the product of `position`, `rotation` and `scale`.
   */
  #readPlaced(): Matrix4 {
    if (this.matrix !== null && this.matrix !== undefined) {
      const matrix = readMatrix(this.matrix);
      if (matrix) return matrix;
      this.warn(
        `<${this.localName}> matrix: expected 16 numbers, the last row 0 0 0 1, or a DOMMatrix; position, rotation and scale are used.`,
      );
    }
    return matrixOf({
      position: this.read<Vector3>('position', written(this.position)),
      rotation: this.read<Vector3>('rotation', written(this.rotation, 'rad')),
      scale: this.read<Vector3>('scale', written(this.scale)),
    });
  }

  /** Returns the parsed value of an attribute. An invalid attribute counts as absent, and logs a warning. @internal */
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
    // If the child is removed together with its parent element, its state is kept as long as that of the parent.
    if (this.parentElement !== this.entry.parent) this.entry.attach(null);
  }

  /** Returns the element itself, because a child has no shadow tree. */
  protected override createRenderRoot(): HTMLElement {
    return this;
  }

  protected override updated(): void {
    this.entry.update();
    this.entry.requestFrame();
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

/** Returns the property declarations of a child for Lit. */
export const childDeclarations = (table: AttributeTable): PropertyDeclarations => ({
  ...declarations(table),
  matrix: { attribute: false },
  hidden: { type: Boolean, reflect: true },
  // Accessors are listed, too, so that they receive values that a page sets before the element is defined.
  currentTime: { attribute: false, noAccessor: true },
  playbackRate: { attribute: false, noAccessor: true },
});

/** Cores of the elements that can have children. */
export const cores = new WeakMap<Element, Viewer>();

const interactions = new WeakMap<Element, Lazy<Interaction>>();

/**
 * Loads the code for clicks on children when the first child becomes interactive. Later calls update its state.
 */
function interactionChanged(child: SplatChild): void {
  const parent = child.parentElement;
  const core = parent && cores.get(parent);
  if (!core) return;
  let code = interactions.get(parent);
  if (code === undefined) {
    if (!child.interactive) return;
    code = new Lazy('the code of clicks on scenes', async () => {
      const { Interaction } = await import('./interaction.js');
      return new Interaction(core);
    });
    interactions.set(parent, code);
  }
  if (code.value) code.value.update();
  else code.want(({ message }) => child.warn(message));
}

/** Attaches a child to its parent element. A parent that is not set up yet attaches its children later. */
export function adopt(child: SplatChild): void {
  const { parentElement } = child;
  // The first update of a child may precede the setup of its parent.
  interactionChanged(child);
  child.entry.attach((parentElement && cores.get(parentElement)) ?? null);
}
