import { Lazy, type Camera } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import type { DetailHost } from './controllers/detail-controller.js';
import { PlaybackController, type PlaybackEvent, type PlaybackHost } from './controllers/playback-controller.js';
import { SceneController, type Entrance, type SceneHost, type SceneState } from './controllers/scene-controller.js';
import { SourceController, type SourceHost } from './controllers/source-controller.js';
import type { ElementError } from './errors.js';
import type { GaussianSplatEventMap } from './events.js';
import type { ViewerFrame } from './camera/orbit.js';
import type { SceneBounds } from './camera/settings.js';
import type { LoadedGaussians } from './gpu/loaded-gaussians.js';
import type { GeneratorInput } from './dynamic/inputs.js';
import { DynamicWiring, type DynamicHost } from './dynamic/dynamic-wiring.js';
import type { ProgressListener } from './loading/protocol.js';
import type { WorldEntry } from './world-entry.js';
import type { Services, Source } from './element-host.js';
import { costOf, type ChildStats } from './stats.js';

/** Services of an entry that no longer belongs to an element. */
const NO_SERVICES = { releaseDelay: 0 } as Services;

/** The interface of the element that an entry uses. */
export interface EntryCore {
  readonly element: ReactiveControllerHost & HTMLElement;
  readonly attributes: Attributes;
  readonly services: Services;
  readonly camera: { frame(bounds: SceneBounds): void };
  /** The camera before the image has a size. */
  readonly firstView: Camera;
  /** Rotation from the world to viewer space. */
  readonly frame: ViewerFrame;
  readonly wantsPreviews: boolean;
  /** The scene would be visible. */
  readonly isInSight: boolean;
  /** Automatic motion is allowed. */
  readonly mayMove: boolean;
  readonly memoryBudget: number | undefined;
  /** Inputs of the displayed models that the page may set. */
  readonly inputs: readonly GeneratorInput[];
  readonly sources: EntryList;
  requestFrame(): void;
  splatsChanged(): void;
}

/** The list that it is in. */
export interface EntryList {
  readonly ownEntry: SourceEntry;
  readonly shown: readonly LoadedGaussians[];
  add(entry: SourceEntry): void;
  remove(entry: SourceEntry): void;
  show(
    entry: SourceEntry,
    scene: LoadedGaussians,
    entrance: Entrance,
    enter: (member: WorldEntry) => void,
  ): Promise<void>;
  left(clear: boolean): void;
  settledOne(): void;
  contextChanged(type: 'contextlost' | 'contextrestored', entry: SourceEntry): void;
}

/** Owner of an entry's source: the element itself, or a child of it. */
export interface SourceOwner {
  readonly element: ReactiveControllerHost & HTMLElement;
  readonly source: Source;
  readonly dynamicValues: DynamicHost['dynamicValues'];
  /** False if it follows the clock of its parent element. */
  readonly hasOwnClock: boolean;
  /** Attributes that differ from those of the element. */
  readonly overrides?: Partial<Attributes>;
  /** Opens sources other than splats. */
  readonly open?: SceneHost['open'];
  /** Sets its transform; absent if its frame is the world's. */
  place?(member: WorldEntry, core: EntryCore): void;
  /** A camera of the world in its own coordinates. */
  seenFrom?(camera: Camera, member: WorldEntry | undefined, core: EntryCore): Camera;
  warn(sentence: string): void;
}

/**
 * The lifecycle of one source of the element or of a child: request, loading, display, clock, generator, and levels of
 * detail.
 */
export class SourceEntry implements SceneHost, SourceHost, PlaybackHost, DynamicHost, DetailHost {
  readonly owner: SourceOwner;
  readonly scene: SceneController;
  readonly ownClock: PlaybackController;
  readonly live: DynamicWiring;
  readonly #source: SourceController;
  /** Only scenes with the attribute `detail`, and those too slow to draw in full during motion, need it. */
  readonly #detail = new Lazy(
    'the code of levels of detail',
    async () => {
      const { DetailController } = await import('./controllers/detail-controller.js');
      return new DetailController(this);
    },
    () => this.#updateDetail(),
  );
  /** The element that it belongs to, or belonged to last. */
  #core: EntryCore | undefined;
  #isIn = false;
  /** Its member of the world. */
  member: WorldEntry | undefined;
  /** Loading progress, 0..1; null while unknown. */
  progress: number | null = null;
  /** It has played or was paused, so it no longer starts automatically. */
  hasBegun = false;
  /** Bytes received, and bytes in total. */
  #bytes: [loaded: number, total: number | undefined] = [0, undefined];

  constructor(owner: SourceOwner, core?: EntryCore) {
    this.owner = owner;
    this.#core = core;
    this.#isIn = core !== undefined;
    this.ownClock = new PlaybackController(this);
    this.live = new DynamicWiring(this);
    this.scene = new SceneController(owner.element, this);
    this.#source = new SourceController(this);
  }

  // Interface of the stage.

  get state(): SceneState {
    return this.scene.state;
  }

  get error(): ElementError | null {
    return this.scene.error;
  }

  /** The clock that it follows. */
  get playback(): PlaybackController {
    return this.owner.hasOwnClock || !this.#core ? this.ownClock : this.#core.sources.ownEntry.ownClock;
  }

  /** Seconds that it moves for; NaN for what does not. */
  get duration(): number {
    return this.scene.scene?.live?.duration ?? NaN;
  }

  /** There is something of it to see. */
  get isShown(): boolean {
    return this.member !== undefined && (this.state === 'ready' || this.scene.isPreview);
  }

  /** Fulfills, and never rejects, once nothing is left to wait for. */
  get settled(): Promise<unknown> {
    return this.scene.settled.then(() => this.#detail.settled);
  }

  get inputs(): readonly GeneratorInput[] {
    return this.member?.scene.live?.inputs ?? [];
  }

  get stats(): ChildStats {
    const { state, error, scene } = this.scene;
    return { element: this.owner.element, state, error, ...costOf(scene) };
  }

  /** Moves the entry to this element, or to none, together with its loaded scene. */
  attach(core: EntryCore | null): void {
    if (this.#isIn && core === this.#core) return this.update();
    if (this.#isIn) this.#core!.sources.remove(this);
    this.#isIn = core !== null;
    if (core === null) return;
    this.#core = core;
    core.sources.add(this);
    this.update();
    const { scene } = this.scene;
    if (scene && !scene.isLost) void this.show(scene, 'again').catch((error: unknown) => this.scene.fail(error));
  }

  /** The element that it belongs to; null for none. */
  get parent(): Element | null {
    return this.#isIn ? this.#core!.element : null;
  }

  /** Reads the attributes again: its owner, or the parent element, may request another source. */
  update(): void {
    if (!this.#isIn) return;
    this.#source.set(this.owner.source);
    if (this.attributes.detail !== 'auto') this.#detail.want(this.#warnOf);
    this.#updateDetail();
    this.startPlaying();
  }

  /** Loads and plays if that is allowed now. */
  request(): void {
    if (!this.#isIn) return;
    this.#source.request();
    this.startPlaying();
  }

  /** Loads the source even if it is not visible, until another one is requested. */
  needNow(): void {
    this.#source.needNow(true);
  }

  reload(): void {
    this.scene.want(null, false);
    this.#source.renew();
    this.owner.element.requestUpdate();
  }

  /** Its owner requests another source than the displayed or loading one. */
  get isLeaving(): boolean {
    return this.#source.isOther(this.owner.source);
  }

  get postprocess(): readonly string[] {
    return this.#source.postprocess;
  }

  /** The clock of a source that plays automatically. */
  get player(): PlaybackController | undefined {
    return this.#core && this.attributes.autoplay ? this.ownClock : undefined;
  }

  /** Starts automatic playback if that is allowed. */
  startPlaying(): void {
    if (!this.hasBegun && this.#core?.mayMove && this.player?.canPlay) this.ownClock.play();
  }

  /** Sets its transform before a frame. */
  place(): void {
    // Reading a member's count may replace its splats in the world.
    if (this.member?.placement && this.#isIn) this.owner.place?.(this.member, this.#core!);
  }

  /** Advances its motion to the time of a frame. The last frame of a scene about to be replaced stays unchanged. */
  advance(camera: Camera, now: number): void {
    if (this.member && !this.scene.isOutgoing) this.live.advance(this.member.scene, this.#seenFrom(camera), now);
  }

  reportMotionFrame(isWhole: boolean): void {
    if (!isWhole) this.#detail.want(this.#warnOf);
    this.#detail.value?.reportMotionFrame(isWhole);
  }

  // Interfaces of the controllers.

  get element(): HTMLElement {
    return this.owner.element;
  }

  get attributes(): Attributes {
    const { overrides } = this.owner;
    // A child has its own attributes before it belongs to an element.
    return overrides ? { ...(this.#core?.attributes as Attributes), ...overrides } : this.#core!.attributes;
  }

  get services(): Services {
    return this.#core?.services ?? NO_SERVICES;
  }

  get isInSight(): boolean {
    return this.#core!.isInSight;
  }

  get isConnected(): boolean {
    return this.#isIn && this.#core!.element.isConnected;
  }

  get wantsPreviews(): boolean {
    return this.#core!.wantsPreviews;
  }

  get memoryBudget(): number | undefined {
    return this.#core!.memoryBudget;
  }

  get open(): SceneHost['open'] {
    return this.owner.open;
  }

  get shown(): readonly LoadedGaussians[] {
    return this.#isOwn ? this.#core!.sources.shown : [];
  }

  get dynamicValues(): DynamicHost['dynamicValues'] {
    return this.owner.dynamicValues;
  }

  get dynamicRequest(): SceneHost['dynamicRequest'] {
    const core = this.#core!;
    return {
      element: this.element,
      runtimeLocation: this.services.runtimeLocation,
      loader: this.services.sceneLoader,
      state: () => this.live.state,
      loops: () => this.playback.loops,
      ownsControls: () => !core.sources.ownEntry.live.hasPost,
      camera: (bounds) => {
        if (bounds && this.#isOwn) core.camera.frame(bounds);
        return this.#seenFrom(core.firstView);
      },
      listeners: this.live.listeners,
    };
  }

  // Notifications of the controllers.

  requestFrame(): void {
    this.#core?.requestFrame();
  }

  splatsChanged(): void {
    this.#core?.splatsChanged();
  }

  warn(sentence: string): void {
    this.owner.warn(sentence);
  }

  dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void {
    this.element.dispatchEvent(event);
  }

  playbackEvent(type: PlaybackEvent): void {
    this.dispatch(new Event(type));
    if (type !== 'play' && type !== 'pause') return;
    this.hasBegun ||= type === 'play';
    // Custom states and the pause button depend on them, too.
    this.#core?.element.requestUpdate();
  }

  async show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    if (!this.#isIn) return;
    if (!this.#isOwn) this.ownClock.setDuration(this.duration);
    await this.#core!.sources.show(this, scene, entrance, (member) => {
      this.leave();
      this.member = member;
      this.place();
      this.live.notifyInputs(this.#isOwn ? this.#core!.inputs : this.inputs);
    });
  }

  hide(clear: boolean): void {
    this.leave();
    this.ownClock.suspend();
    if (clear) this.ownClock.empty();
    if (this.#isIn) this.#core!.sources.left(clear);
  }

  /** Leaves the world: its splats are about to be freed, or to be shown in another element. */
  leave(): void {
    this.member?.remove();
    this.member = undefined;
  }

  loadStarted(): void {
    this.dispatch(new Event('loadstart'));
  }

  progressed(...[loaded, total, share = total ? loaded / total : undefined]: Parameters<ProgressListener>): void {
    this.#bytes = [loaded, total];
    this.progress = share === undefined ? null : Math.min(1, share);
    this.#core?.element.requestUpdate();
    this.dispatch(new ProgressEvent('progress', { lengthComputable: total !== undefined, loaded, total: total ?? 0 }));
  }

  previewShown({ gaussians }: LoadedGaussians): void {
    this.dispatch(new CustomEvent('preview', { detail: { splats: gaussians.count } }));
    this.progressed(...this.#bytes);
  }

  loaded(url: string): void {
    this.notifyLoaded(url);
    this.update();
    this.#core?.sources.settledOne();
  }

  notifyLoaded(url: string): void {
    for (const type of ['loadeddata', 'canplay'] as const) this.dispatch(new Event(type));
    this.dispatch(new CustomEvent('load', { detail: { url } }));
  }

  notifyFailed(error: ElementError): void {
    this.dispatch(new CustomEvent('error', { detail: error }));
  }

  emptied(): void {
    this.#source.needNow(false);
    this.progress = null;
    this.hasBegun = false;
    this.ownClock.empty();
    this.ownClock.stopWaits();
    this.dispatch(new Event('emptied'));
    // The other sources are restored; the loss of this one is reported by the scene that replaces it.
    if (!this.#isOwn) this.contextChanged('contextrestored');
  }

  failed(error: ElementError): void {
    this.progress = null;
    this.notifyFailed(error);
    if (!this.#isOwn) this.contextChanged('contextrestored');
    this.#core?.sources.settledOne();
  }

  contextChanged(type: 'contextlost' | 'contextrestored'): void {
    this.#core?.sources.contextChanged(type, this);
  }

  get #isOwn(): boolean {
    return this.#core?.sources.ownEntry === this;
  }

  #updateDetail(): void {
    this.#detail.value?.update(this.#isIn && this.state === 'ready' ? this.scene.scene : null);
  }

  readonly #warnOf = ({ message }: Error): void => this.warn(message);

  #seenFrom(camera: Camera): Camera {
    return this.owner.seenFrom?.(camera, this.member, this.#core!) ?? camera;
  }
}
