import { Lazy, type Camera } from '@gaussian-splat/core';
import { World } from '@gaussian-splat/renderer';
import { boundsOfWorld } from '@gaussian-splat/renderer/tools';
import type { SceneBounds } from './camera/settings.js';
import type { MotionHost } from './controllers/motion-controller.js';
import type { Entrance, SceneState } from './controllers/scene-controller.js';
import type { ElementError } from './errors.js';
import type { ViewerFrame } from './camera/orbit.js';
import type { CameraController } from './controllers/camera-controller.js';
import type { LoadedGaussians } from './gpu/loaded-gaussians.js';
import type { LodSettings, Drawable } from './gpu/painter.js';
import { Member } from './member.js';
import type { EntryList, SourceEntry } from './source-entry.js';

/** States from the one that says most of several entries on. */
const STATES: readonly SceneState[] = ['ready', 'loading', 'waiting', 'failed'];

/** What the list asks of its element, and what it tells it. */
export interface ListStage {
  readonly camera: Pick<CameraController, 'frame' | 'refine'>;
  readonly frame: ViewerFrame;
  requestFrame(): void;
  splatsChanged(): void;
  prepareFor(scene: LoadedGaussians): Promise<void>;
  /** Draws what is in the world from now on. Fulfils with the first frame of it. */
  draw(scene: Drawable): Promise<void>;
  /** Nothing is shown any more; the last image stays unless it is to be cleared. */
  stopDrawing(clear: boolean): void;
  warn(sentence: string): void;
  dispatch(event: Event): void;
}

/** All sources of an element, its own and then those of its children, and what holds for all of them together. */
export class SourceList implements EntryList {
  /** All that is drawn. */
  readonly world = new World();
  readonly own: SourceEntry;
  readonly meshes = new Lazy('the code that shows meshes', async () => {
    const { Meshes } = await import('./meshes/meshes.js');
    return new Meshes(this, this.#stage);
  });
  readonly #stage: ListStage;
  readonly #all: SourceEntry[];
  /** They come one after the other, so that one that fails is known. */
  #arrivals: Promise<void> | undefined;
  #latest: SourceEntry | undefined;
  #isFramed = false;
  #isToldLoaded = false;
  readonly #lost = new Set<SourceEntry>();

  constructor(stage: ListStage, own: SourceEntry) {
    this.#stage = stage;
    this.own = own;
    this.#all = [own];
  }

  // Who is there.

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

  get members(): readonly Member[] {
    return this.#all.flatMap(({ member }) => member ?? []);
  }

  get shown(): readonly LoadedGaussians[] {
    return this.members.map(({ scene }) => scene);
  }

  get #isEmpty(): boolean {
    return this.members.length === 0;
  }

  // Coming and going.

  /**
   * Shows what an entry has loaded, once those before it are drawn. Fulfils when it is, or need not be any more; rejects with GaussianSplatError `out-of-memory/*`.
   * @param enter puts it into the world
   */
  show(entry: SourceEntry, scene: LoadedGaussians, entrance: Entrance, enter: (member: Member) => void): Promise<void> {
    const show = async (): Promise<void> => {
      if (scene.model) await (await this.meshes.get()).prepare(scene);
      await this.#stage.prepareFor(scene);
      if (scene.isDestroyed || scene.isLost || entry.scene.scene !== scene || !this.#all.includes(entry)) return;
      scene.onChange = () => this.#stage.requestFrame();
      for (const warning of scene.warnings) this.#stage.warn(`<gaussian-splat>: ${warning}`);
      enter(new Member(this.world, scene));
      this.#latest = entry;
      this.changed();
      if (scene.hasMeshes) void this.#addMeshes(entry, scene);
      this.frame(entrance, entry);
      await this.#stage.draw(scene);
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

  /** Something is shown no more: draws what is left, or nothing. */
  left(clear: boolean): void {
    this.#stage.splatsChanged();
    if (this.#isEmpty) {
      if (clear) this.#isToldLoaded = this.#isFramed = false;
      this.#stage.stopDrawing(clear);
    }
    this.meshes.value?.forget();
  }

  /** What came last was too much; whatever else it was, what is left is tried again. */
  fail(error: unknown): void {
    const entered = this.#all.filter(({ member }) => member !== undefined);
    const latest = entered.find((entry) => entry === this.#latest);
    this.#latest = undefined;
    (latest ?? (this.own.member ? this.own : (entered.at(-1) ?? this.own))).scene.fail(error);
  }

  /** The camera sees all of it. */
  frame(entrance: Entrance, entry?: SourceEntry): void {
    const { bounds } = this;
    if (entrance === 'again' || bounds === null) return;
    const { camera } = this.#stage;
    if (!this.#isFramed || (entry === this.own && entrance === 'new')) camera.frame(bounds);
    else camera.refine(bounds);
    this.#isFramed = true;
  }

  /** Other splats are drawn, or move for another time. */
  changed(): void {
    this.#setDuration();
    this.#stage.splatsChanged();
  }

  /** One is shown, or cannot be. */
  settledOne(): void {
    this.changed();
    // The events of an element without a scene of its own are those of its children together.
    const isOver = this.#all.every(({ state }) => state !== 'loading' && state !== 'waiting');
    if (this.own.state !== 'empty' || !isOver || this.#isToldLoaded) return;
    const shown = this.#all.find(({ state }) => state === 'ready');
    this.#isToldLoaded = shown !== undefined;
    if (shown) this.own.tellLoaded(shown.scene.url);
    else if (this.error) this.own.tellFailed(this.error);
  }

  /** Tells the page that a device was lost, or that all is back. */
  contextChanged(type: 'contextlost' | 'contextrestored', entry: SourceEntry): void {
    const before = this.#lost.size;
    if (type === 'contextlost') this.#lost.add(entry);
    else this.#lost.delete(entry);
    if (type === 'contextlost' ? before === 0 : before > 0 && this.#lost.size === 0)
      this.#stage.dispatch(new Event(type));
  }

  /** The triangles of a file that has splats, too: they come after these, and what is wrong with them leaves the splats visible. */
  async #addMeshes(entry: SourceEntry, scene: LoadedGaussians): Promise<void> {
    try {
      await (await this.meshes.get()).add(entry, scene);
      this.frame('whole');
      this.changed();
    } catch (error) {
      if (scene.isDestroyed) return;
      const warning = `The triangles are not shown: ${(error as Error).message}`;
      scene.warnings = [...scene.warnings, warning];
      this.#stage.warn(`<gaussian-splat>: ${warning}`);
    }
  }

  // What holds for all.

  get state(): SceneState {
    const { state } = this.own;
    if (state !== 'empty' && state !== 'failed') return state;
    return STATES.find((each) => this.#all.some((entry) => entry.state === each)) ?? state;
  }

  /** Why nothing is shown. */
  get error(): ElementError | null {
    const { error, state } = this.own;
    if (error || state !== 'empty' || this.state !== 'failed') return error;
    return this.#all.find((entry) => entry.error)?.error ?? null;
  }

  /** Fulfils, and never rejects, once nothing is left to wait for. */
  get settled(): Promise<unknown> {
    return Promise.all(this.#all.map(({ settled }) => settled));
  }

  /** Share of the loading that is done, 0..1; null while it is not known. */
  get progress(): number | null {
    const wanted = this.#all.filter(({ state }) => state !== 'empty' && state !== 'failed');
    const shares = wanted.map(({ state, progress }) => (state === 'ready' ? 1 : progress));
    const known = shares.filter((share) => share !== null);
    return known.length > 0 ? known.reduce((sum, share) => sum + share, 0) / shares.length : null;
  }

  get hasPicture(): boolean {
    return this.#all.some(({ state, scene }) => state === 'ready' || scene.isPreview);
  }

  get isPreview(): boolean {
    return this.#all.some(({ scene }) => scene.isPreview);
  }

  get levels(): LodSettings {
    const most = (of: (settings: LodSettings) => number | undefined): number =>
      Math.max(0, ...this.members.map(({ scene }) => of(scene.detail) ?? 0));
    return { detail: most(({ detail }) => detail), splatBudget: most(({ splatBudget }) => splatBudget) };
  }

  /** Where all of it is, in the frame of the element's own scene; null while nothing is shown. */
  get bounds(): SceneBounds | null {
    this.place();
    const bounds = boundsOfWorld(this.world);
    return bounds ? { ...bounds, up: this.own.member?.scene.bounds.up } : null;
  }

  /** The same, measured anew where a generator may have moved it. */
  async readBounds(): Promise<SceneBounds | null> {
    await Promise.all(
      this.members.map(async (member) => {
        const bounds = await member.scene.live?.readBounds?.();
        if (bounds) member.placement.bounds = bounds;
      }),
    );
    return this.bounds;
  }

  /** What plays by itself. */
  get player(): MotionHost['player'] {
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
      ? this.#all.flatMap((entry) => (entry.state === 'empty' && entry === this.own ? [] : [entry.stats]))
      : [];
  }

  // What all do.

  place(): void {
    for (const entry of this.#all) entry.place();
  }

  advance(camera: Camera, now: number): void {
    // Its own scene may stand still while others follow the element's clock.
    this.own.ownClock.tick(now);
    for (const entry of this.#all) entry.advance(camera, now);
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

  /** They may be loaded, or play, now. */
  request(): void {
    for (const entry of this.#all) entry.request();
  }

  /** The element's clock goes as far as its own scene, or else as what follows it. */
  #setDuration(): void {
    const { own } = this;
    if (own.member === undefined && (own.state === 'waiting' || own.state === 'loading')) return;
    // What has gone with a device comes back, and its time goes on.
    if (this.#lost.size > 0) return;
    const clock = own.ownClock;
    const couldPlay = clock.canPlay;
    const followed = this.#all.flatMap((entry) => (entry.owner.hasOwnClock ? [] : [entry.duration]));
    const moving = followed.filter((seconds) => !Number.isNaN(seconds));
    clock.setDuration(Number.isNaN(own.duration) && moving.length > 0 ? Math.max(...moving) : own.duration);
    // What follows the clock may come when the poster has gone.
    if (!couldPlay && clock.canPlay) own.startPlaying();
  }
}
