import { Lazy, type Camera } from '@gaussian-splat/core';
import { World } from '@gaussian-splat/renderer';
import { boundsOfWorld } from '@gaussian-splat/renderer/tools';
import type { SceneBounds } from './camera/settings.js';
import type { Player } from './playback-controller.js';
import type { Entrance, SceneState } from './scene-controller.js';
import type { ElementError } from './errors.js';
import type { ViewerFrame } from './camera/orbit.js';
import type { CameraController } from './camera-controller.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { LodSettings, Drawable } from '../gpu/backend.js';
import { WorldEntry } from './world-entry.js';
import type { EntryList, SourceEntry } from './source-entry.js';

/** States by descending priority: the element has the first of these that any of its sources has. */
const STATES: readonly SceneState[] = ['ready', 'loading', 'waiting', 'failed'];

/** The part of the element that the list uses. */
export interface ListCore {
  readonly element: EventTarget;
  readonly camera: Pick<CameraController, 'frame' | 'refine' | 'isTouched'>;
  readonly frame: ViewerFrame;
  requestFrame(): void;
  splatsChanged(): void;
  prepareFor(scene: LoadedGaussians): Promise<void>;
  /** Starts to draw the world with the renderer of a scene. Fulfills with the first frame. */
  draw(scene: Drawable): Promise<void>;
  /** Stops drawing. `clear` also clears the canvas; otherwise the last image stays. */
  stopDrawing(clear: boolean): void;
  warn(sentence: string): void;
}

/**
 * All sources of an element, and the state that they have together. The first is the element's own source, the others
 * belong to its children.
 */
export class SourceList implements EntryList {
  /** The world with the splats of all shown sources. */
  readonly world = new World();
  readonly ownEntry: SourceEntry;
  readonly meshes = new Lazy('the code that shows meshes', async () => {
    const { Meshes } = await import('../sources/mesh/meshes.js');
    return new Meshes(this, this.#core);
  });
  readonly #core: ListCore;
  readonly #all: SourceEntry[];
  /**
   * Settles when the sources that have arrived are shown. They are shown in sequence, so that a failure can be
   * attributed to one of them.
   */
  #arrivals: Promise<void> | undefined;
  #latest: SourceEntry | undefined;
  #isFramed = false;
  #bounds: SceneBounds | null = null;
  #isLoadReported = false;
  readonly #lost = new Set<SourceEntry>();

  constructor(core: ListCore, ownEntry: SourceEntry) {
    this.#core = core;
    this.ownEntry = ownEntry;
    this.#all = [ownEntry];
  }

  // Membership.

  add(entry: SourceEntry): void {
    this.#all.push(entry);
    this.changed();
  }

  remove(entry: SourceEntry): void {
    this.#all.splice(this.#all.indexOf(entry), 1);
    entry.leave();
    this.contextChanged('contextrestored', entry);
    this.left(true);
    this.changed();
  }

  get entries(): readonly SourceEntry[] {
    return this.#all;
  }

  get members(): readonly WorldEntry[] {
    return this.#all.flatMap(({ member }) => member ?? []);
  }

  get shown(): readonly LoadedGaussians[] {
    return this.members.map(({ scene }) => scene);
  }

  get #isEmpty(): boolean {
    return this.members.length === 0;
  }

  // Showing and hiding.

  /**
   * Shows an entry's loaded scene after those that arrived before it. Fulfills when the scene is shown or not needed
   * anymore. Rejects with GaussianSplatError `out-of-memory/*`.
   * @param enter called with the new member of the world
   */
  show(
    entry: SourceEntry,
    scene: LoadedGaussians,
    entrance: Entrance,
    enter: (member: WorldEntry) => void,
  ): Promise<void> {
    const show = async (): Promise<void> => {
      if (scene.model) await (await this.meshes.get()).prepare(scene);
      await this.#core.prepareFor(scene);
      if (scene.isDestroyed || scene.place.isLost || entry.scene.scene !== scene || !this.#all.includes(entry)) return;
      scene.onChange = () => this.#core.requestFrame();
      // The page that sets `up` knows that the file does not.
      for (const warning of scene.warnings)
        if (!entry.owner.ownUp || !warning.includes('up="')) this.#core.warn(`<gaussian-splat>: ${warning}`);
      enter(new WorldEntry(this.world, scene));
      this.#latest = entry;
      this.changed();
      if (scene.hasMeshes) void this.#addMeshes(entry, scene);
      this.frame(entrance, entry);
      await this.#core.draw(scene);
    };
    const shown = this.#arrivals ? this.#arrivals.then(show) : show();
    const over = shown
      .catch(() => undefined)
      .then(() => {
        if (this.#arrivals === over) this.#arrivals = undefined;
      });
    this.#arrivals = over;
    return shown;
  }

  /**
   * Draws the remaining sources after one was hidden. `clear` clears the canvas if none remains; otherwise the last
   * image stays.
   */
  left(clear: boolean): void {
    this.#core.splatsChanged();
    if (this.#isEmpty) {
      if (clear) this.#isLoadReported = this.#isFramed = false;
      this.#core.stopDrawing(clear);
    }
    this.meshes.value?.forget();
  }

  /**
   * Reports a failure of drawing to the source that was shown last, which is then removed. The remaining sources are
   * drawn again.
   */
  fail(error: unknown): void {
    const entered = this.#all.filter(({ member }) => member !== undefined);
    const latest = entered.find((entry) => entry === this.#latest);
    this.#latest = undefined;
    (latest ?? (this.ownEntry.member ? this.ownEntry : (entered.at(-1) ?? this.ownEntry))).scene.fail(error);
  }

  /**
   * Moves the camera to frame all sources for the first one, which may come from another element, and for a new scene of
   * the element itself; otherwise adapts it to the new bounds.
   */
  frame(entrance: Entrance, entry?: SourceEntry): void {
    const { bounds } = this;
    const { camera } = this.#core;
    const isAgain = entrance === 'again';
    if ((isAgain && this.#isFramed) || bounds === null) return;
    // A visitor who has moved the camera finds a scene that returns where it was.
    const isFirst = !this.#isFramed && !(isAgain && camera.isTouched);
    if (isFirst || (entry === this.ownEntry && entrance === 'new')) camera.frame(bounds);
    else camera.refine(bounds);
    this.#isFramed = true;
  }

  /** Updates the duration and requests a frame, after the drawn splats or their duration have changed. */
  changed(): void {
    this.#setDuration();
    this.#core.splatsChanged();
  }

  /**
   * Call when a source is shown or has failed. Updates the duration, and may fire `load` or `error` for an element without
   * a source of its own.
   */
  settledOne(): void {
    this.changed();
    // An element without a source of its own fires `load` or `error` when all children are shown or have failed.
    const isOver = this.#all.every(({ scene: { state } }) => state !== 'loading' && state !== 'waiting');
    if (this.ownEntry.scene.state !== 'empty' || !isOver || this.#isLoadReported) return;
    const shown = this.#all.find(({ scene }) => scene.state === 'ready');
    this.#isLoadReported = shown !== undefined;
    if (shown) this.ownEntry.notifyLoaded(shown.scene.url);
    else if (this.error) this.ownEntry.notifyFailed(this.error);
  }

  /**
   * Fires `contextlost` for the first source that loses its device, and `contextrestored` when all sources are
   * restored.
   */
  contextChanged(type: 'contextlost' | 'contextrestored', entry: SourceEntry): void {
    const before = this.#lost.size;
    if (type === 'contextlost') this.#lost.add(entry);
    else this.#lost.delete(entry);
    if (type === 'contextlost' ? before === 0 : before > 0 && this.#lost.size === 0)
      this.#core.element.dispatchEvent(new Event(type));
  }

  /**
   * Loads the meshes of a file that also has splats, after the splats. If it fails, the splats stay visible, with a
   * warning.
   */
  async #addMeshes(entry: SourceEntry, scene: LoadedGaussians): Promise<void> {
    try {
      await (await this.meshes.get()).add(entry, scene);
      this.frame('whole');
      this.changed();
    } catch (error) {
      if (scene.isDestroyed) return;
      const warning = `The triangles are not shown: ${(error as Error).message}`;
      scene.warnings = [...scene.warnings, warning];
      this.#core.warn(`<gaussian-splat>: ${warning}`);
    }
  }

  // State of all sources together.

  get state(): SceneState {
    const { state } = this.ownEntry.scene;
    if (state !== 'empty' && state !== 'failed') return state;
    return STATES.find((each) => this.#all.some(({ scene }) => scene.state === each)) ?? state;
  }

  /** Whether the scene is shown; for an element without a source of its own, whether `load` was fired. */
  get isLoaded(): boolean {
    return this.ownEntry.scene.state === 'empty' ? this.#isLoadReported : this.state === 'ready';
  }

  /**
   * Reason that nothing is shown: the error of the element's own source, or else of the first child with an error; null
   * if there is none.
   */
  get error(): ElementError | null {
    const { error, state } = this.ownEntry.scene;
    if (error || state !== 'empty' || this.state !== 'failed') return error;
    return this.#all.find(({ scene }) => scene.error)?.scene.error ?? null;
  }

  /** Fulfills when no source is loading or pending. Never rejects. */
  get settled(): Promise<unknown> {
    return Promise.all(this.#all.map(({ settled }) => settled));
  }

  /** Mean loading progress of all sources, 0..1; null while it is unknown. */
  get progress(): number | null {
    const wanted = this.#all.filter(({ scene: { state } }) => state !== 'empty' && state !== 'failed');
    const shares = wanted.map(({ scene, progress }) => (scene.state === 'ready' ? 1 : progress));
    const known = shares.filter((share) => share !== null);
    return known.length > 0 ? known.reduce((sum, share) => sum + share, 0) / shares.length : null;
  }

  get hasImage(): boolean {
    return this.#all.some(({ scene }) => scene.state === 'ready' || scene.isPreview);
  }

  get isPreview(): boolean {
    return this.#all.some(({ scene }) => scene.isPreview);
  }

  get levels(): LodSettings {
    const max = (of: (settings: LodSettings) => number | undefined): number =>
      Math.max(0, ...this.members.map(({ scene }) => of(scene.detail) ?? 0));
    return { detail: max(({ detail }) => detail), splatBudget: max(({ splatBudget }) => splatBudget) };
  }

  /** Bounds of all sources in world coordinates; null while nothing is shown. */
  get bounds(): SceneBounds | null {
    this.place();
    const bounds = boundsOfWorld(this.world);
    const { up, orbit } = this.ownEntry.member?.scene.bounds ?? ({} as Partial<SceneBounds>);
    if (bounds) this.#bounds = { ...bounds, up, orbit };
    // Scenes that were released out of view, or lost with their device, keep their bounds.
    return bounds || this.hasImage ? this.#bounds : null;
  }

  /** Returns {@link bounds} after the bounds of generators, whose splats may have moved, were measured again. */
  async readBounds(): Promise<SceneBounds | null> {
    await Promise.all(
      this.members.map(async (member) => {
        const bounds = await member.scene.live?.readBounds?.();
        if (bounds) member.placement.bounds = bounds;
      }),
    );
    return this.bounds;
  }

  /** Plays and pauses all sources that play automatically; undefined if there are none. */
  get player(): Player | undefined {
    const clocks = this.#all.flatMap(({ player }) => player ?? []);
    if (clocks.length === 0) return undefined;
    const playable = clocks.filter(({ canPlay }) => canPlay);
    return {
      canPlay: playable.length > 0,
      paused: playable.every(({ paused }) => paused),
      play: () => playable.forEach((clock) => clock.play()),
      pause: () => playable.forEach((clock) => clock.pause()),
    };
  }

  get stats(): SourceEntry['stats'][] {
    return this.#all.length > 1
      ? this.#all.flatMap((entry) => (entry.scene.state === 'empty' && entry === this.ownEntry ? [] : [entry.stats]))
      : [];
  }

  // Operations on all sources.

  place(): void {
    for (const entry of this.#all) entry.place();
  }

  advance(camera: Camera, now: number): void {
    // Each clock advances once, to the first frame that any of its sources lacks. The element's clock may advance
    // children even if its own scene does not move.
    for (const clock of new Set([this.ownEntry.ownClock, ...this.#all.map(({ playback }) => playback)]))
      clock.tick(now, Math.min(...this.#all.map((entry) => entry.loadedUntil(clock))));
    for (const entry of this.#all) entry.advance(camera);
  }

  suspend(): void {
    for (const { ownClock } of this.#all) ownClock.suspend();
  }

  startPlaying(): void {
    for (const entry of this.#all) entry.startPlaying();
  }

  reportMotionFrame(isWhole: boolean): void {
    for (const entry of this.#all) entry.reportMotionFrame(isWhole);
  }

  /** Loads and plays the sources if the attributes and the visibility allow that. */
  request(): void {
    for (const entry of this.#all) entry.request();
  }

  /**
   * Sets the duration of the element's clock: that of its own scene, or else the longest of the sources that follow
   * this clock.
   */
  #setDuration(): void {
    const { ownEntry } = this;
    // A scene that is about to be replaced is still shown, but its clock is that of the next scene.
    const { isOutgoing, state } = ownEntry.scene;
    if (isOutgoing && (state === 'waiting' || state === 'loading')) return;
    // Sources that were lost with a device will be restored, and their playback then continues.
    if (this.#lost.size > 0) return;
    const clock = ownEntry.ownClock;
    const couldPlay = clock.canPlay;
    const followed = this.#all.flatMap((entry) => (entry.owner.hasOwnClock ? [] : [entry.duration]));
    const moving = followed.filter((seconds) => !Number.isNaN(seconds));
    clock.setDuration(Number.isNaN(ownEntry.duration) && moving.length > 0 ? Math.max(...moving) : ownEntry.duration);
    // Sources that follow this clock may start here after the poster is dismissed.
    if (!couldPlay && clock.canPlay) ownEntry.startPlaying();
  }
}
