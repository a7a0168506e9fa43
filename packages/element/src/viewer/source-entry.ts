import { Lazy, type Camera, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { ReactiveControllerHost, ReactiveElement } from 'lit';
import type { Attributes } from './attributes.js';
import type { DetailHost } from '../sources/stream/detail-controller.js';
import {
  PLAYABLE,
  notPlayed,
  PlaybackController,
  type PlaybackEvent,
  type PlaybackHost,
} from './playback-controller.js';
import { SceneController, type Entrance, type SceneHost } from './scene-controller.js';
import { SourceController, type SourceHost } from './source-controller.js';
import type { ElementError } from './errors.js';
import type { ViewerFrame } from './camera/orbit.js';
import type { SceneBounds } from './camera/settings.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { GeneratorInput } from '../sources/generator/inputs.js';
import { DynamicWiring, type DynamicHost } from '../sources/generator/dynamic-wiring.js';
import type { ProgressListener } from '../loading/protocol.js';
import type { WorldEntry } from './world-entry.js';
import type { Services, Source } from './element-host.js';
import { costOf, type ChildStats } from './stats.js';

/** Services of an entry that belongs to no element. */
const NO_SERVICES = { releaseDelay: 0 } as Services;

/** The part of the element that an entry uses. */
export interface EntryCore {
  readonly element: ReactiveControllerHost & HTMLElement;
  readonly attributes: Attributes;
  readonly services: Services;
  readonly camera: { frame(bounds: SceneBounds): void };
  /** The camera at the default size of an element, for a generator that runs before the image has a size. */
  readonly firstView: Camera;
  /** Rotation from world coordinates to viewer space. */
  readonly frame: ViewerFrame;
  readonly wantsPreviews: boolean;
  /** Whether the scene would be visible if it were loaded. */
  readonly isInSight: boolean;
  /** Whether automatic motion is allowed. */
  readonly mayMove: boolean;
  readonly memoryBudget: number | undefined;
  /** Inputs of the displayed models that the page may set. */
  readonly inputs: readonly GeneratorInput[];
  readonly sources: EntryList;
  requestFrame(): void;
  splatsChanged(): void;
}

/** The part of {@link SourceList} that an entry uses. */
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
  changed(): void;
  settledOne(): void;
  contextChanged(type: 'contextlost' | 'contextrestored', entry: SourceEntry): void;
}

/** Owner of an entry's source: the element itself, or a child of it. */
export interface SourceOwner {
  readonly element: ReactiveControllerHost & HTMLElement & Pick<ReactiveElement, 'isUpdatePending'>;
  readonly source: Source;
  readonly dynamicValues: DynamicHost['owner']['dynamicValues'];
  /** False if the source follows the clock of its parent element. */
  readonly hasOwnClock: boolean;
  /** Up direction that the page sets, in the axes of the file; undefined for that of the file. */
  readonly ownUp: Vector3 | undefined;
  /** Attributes of a child, which take precedence over those of the element. */
  readonly overrides?: Partial<Attributes>;
  /** Sets the transform of the source; absent if its frame is that of the world. */
  place?(member: WorldEntry, core: EntryCore): void;
  /** Returns the matrix from the coordinates of nested children (y up) to the world; absent for the element itself. */
  frameToWorld?(member: WorldEntry): Matrix4;
  /** Converts a camera from world coordinates to those of the source; absent if they are equal. */
  seenFrom?(camera: Camera, member: WorldEntry | undefined, core: EntryCore): Camera;
  warn(sentence: string): void;
}

/**
 * The lifecycle of one source of the element or of a child: request, loading, display, clock, generator, and levels of
 * detail.
 */
export class SourceEntry implements SceneHost, SourceHost, PlaybackHost, DynamicHost, DetailHost {
  readonly owner: SourceOwner;
  readonly element: HTMLElement;
  readonly scene: SceneController;
  readonly ownClock: PlaybackController;
  readonly live: DynamicWiring;
  readonly #source: SourceController;
  /** Levels of detail: of scenes with the attribute `detail`, and of those too slow to be drawn in full in motion. */
  readonly #detail = new Lazy(
    'the code of levels of detail',
    async () => {
      const { DetailController } = await import('../sources/stream/detail-controller.js');
      return new DetailController(this);
    },
    () => this.#updateDetail(),
  );
  /** The element that the entry belongs to, or belonged to last. */
  core: EntryCore | undefined;
  #isIn = false;
  /** The loaded source in the world; undefined while it is not shown. */
  member: WorldEntry | undefined;
  /** Loading progress, 0..1; null while unknown. */
  progress: number | null = null;
  /** Whether the source has played or was paused, after which it does not start automatically. */
  #hasBegun = false;
  /** Whether that was for the source that the owner requests next, so that it outlasts the current one. */
  #isForNext = false;
  /** Bytes received and bytes in total; the total is undefined while unknown. */
  #bytes: [loaded: number, total: number | undefined] = [0, undefined];

  constructor(owner: SourceOwner, core?: EntryCore) {
    this.owner = owner;
    this.element = owner.element;
    this.core = core;
    this.#isIn = core !== undefined;
    this.ownClock = new PlaybackController(this);
    this.live = new DynamicWiring(this);
    this.scene = new SceneController(owner.element, this);
    this.#source = new SourceController(this);
  }

  // Interface for the element and for children.

  /** The clock of the source: its own, or that of the parent element. */
  get playback(): PlaybackController {
    return this.owner.hasOwnClock || !this.core ? this.ownClock : this.core.sources.ownEntry.ownClock;
  }

  /** Duration of the animation in seconds; NaN for a source that does not move. */
  get duration(): number {
    return this.scene.scene?.live?.duration ?? NaN;
  }

  /** Whether the source is shown in full or as a preview. */
  get isShown(): boolean {
    return this.member !== undefined && (this.scene.state === 'ready' || this.scene.isPreview);
  }

  /** Fulfills when the source and its levels of detail are neither loading nor pending. Never rejects. */
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

  /** Moves the entry with its loaded scene to another element; null removes it from its element. */
  attach(core: EntryCore | null): void {
    if (this.#isIn && core === this.core) return this.update();
    if (this.#isIn) this.core!.sources.remove(this);
    this.#isIn = core !== null;
    if (core === null) return;
    this.core = core;
    core.sources.add(this);
    this.update();
    const { scene } = this.scene;
    if (scene && !scene.place.isLost) void this.show(scene, 'again').catch((error: unknown) => this.scene.fail(error));
  }

  /** The element that the entry belongs to; null if there is none. */
  get parent(): Element | null {
    return this.#isIn ? this.core!.element : null;
  }

  /** Reads the attributes of its owner and of the parent element again, which may request another source. */
  update(): void {
    if (!this.#isIn) return;
    this.#source.set(this.owner.source);
    if (!this.isLeaving) {
      this.#isForNext = false;
      this.ownClock.keepScene();
    }
    if (this.attributes.detail !== 'auto') this.#detail.want(this.#warnOf);
    this.#updateDetail();
    this.startPlaying();
  }

  /** Loads and plays the source if the attributes and the visibility allow that. */
  request(): void {
    if (!this.#isIn) return;
    this.#source.request();
    this.startPlaying();
  }

  /** Allows the source to load while it is not visible, from the next update until another source is requested. */
  needNow(): void {
    this.#source.needNow(true);
  }

  reload(): void {
    this.scene.want(null, false);
    this.#source.renew();
    this.owner.element.requestUpdate();
  }

  /** Whether its owner requests another source than the one that is displayed or loading. */
  get isLeaving(): boolean {
    return this.#source.isOther(this.owner.source);
  }

  /** Prevents the automatic start of the source, or of the one that its owner has just requested. */
  begin(): void {
    this.#hasBegun = true;
    // The attributes that are set but not read yet may request another source.
    this.#isForNext = this.owner.element.isUpdatePending;
  }

  /**
   * Resolves when the source of its owner is requested. Rejects with an `AbortError` if `pause()` is called or another
   * source is set first.
   */
  async requested(): Promise<void> {
    const { owner, playback } = this;
    const { src } = owner.source;
    const { pauses } = playback;
    await owner.element.updateComplete;
    if (playback.pauses !== pauses || owner.source.src !== src) throw notPlayed();
  }

  /** Seeks to a time in seconds: of the displayed source, or of the one that its owner has just requested. */
  seek(seconds: number): void {
    if (this.isLeaving) this.playback.startNextAt(seconds);
    else this.playback.currentTime = seconds;
  }

  get postprocess(): readonly string[] {
    return this.#source.postprocess;
  }

  /** The clock of the source if it plays automatically, else undefined. */
  get player(): PlaybackController | undefined {
    return this.core && this.attributes.autoplay ? this.ownClock : undefined;
  }

  /** Starts automatic playback if it is allowed, and if the source has neither played nor been paused before. */
  startPlaying(): void {
    if (!this.#hasBegun && this.core?.mayMove && this.player?.canPlay) this.ownClock.play();
  }

  /** Sets the transform of the source in the world. Called before each frame. */
  place(): void {
    // The getter `placement` may replace the splats of a member in the world.
    if (this.member?.placement && this.#isIn) this.owner.place?.(this.member, this.core!);
  }

  /**
   * Returns the first time in seconds, from that of a clock on, whose frame is not loaded. Infinity if the clock need
   * not wait for this source.
   */
  loadedUntil(clock: PlaybackController): number {
    const live = this.playback === clock ? this.#advancing?.live : undefined;
    return live?.loadedUntil?.(clock.currentTime) ?? Infinity;
  }

  /** Requests the frame at the time of the clock. */
  advance(camera: Camera): void {
    if (this.#advancing) this.live.advance(this.#advancing, this.#seenFrom(camera));
  }

  /** The shown scene. Undefined for a scene that is about to be replaced, which keeps its last frame. */
  get #advancing(): LoadedGaussians | undefined {
    return this.scene.isOutgoing ? undefined : this.member?.scene;
  }

  reportMotionFrame(isWhole: boolean): void {
    if (!isWhole) this.#detail.want(this.#warnOf);
    this.#detail.value?.reportMotionFrame(isWhole);
  }

  // Properties that the controllers read.

  get attributes(): Attributes {
    const { overrides } = this.owner;
    // A child has attributes before it belongs to an element.
    return overrides ? { ...(this.core?.attributes as Attributes), ...overrides } : this.core!.attributes;
  }

  get services(): Services {
    return this.core?.services ?? NO_SERVICES;
  }

  get isConnected(): boolean {
    return this.#isIn && this.core!.element.isConnected;
  }

  get memoryBudget(): number | undefined {
    return this.core?.memoryBudget;
  }

  get shown(): readonly LoadedGaussians[] {
    return this.#isOwn ? this.core!.sources.shown : [];
  }

  get dynamicRequest(): SceneHost['dynamicRequest'] {
    const core = this.core!;
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
    this.core?.requestFrame();
  }

  splatsChanged(): void {
    this.core?.splatsChanged();
  }

  playbackEvent(type: PlaybackEvent): void {
    this.element.dispatchEvent(new Event(type));
    if (type !== 'play' && type !== 'pause') return;
    if (type === 'play') this.#hasBegun = true;
    // Custom states and the pause button of the element depend on the state of playback.
    this.core?.element.requestUpdate();
  }

  async show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    if (!this.#isIn) return;
    if (!this.#isOwn) this.ownClock.setDuration(this.duration);
    await this.core!.sources.show(this, scene, entrance, (member) => {
      this.leave();
      this.member = member;
      this.place();
      this.live.notifyInputs(this.#isOwn ? this.core!.inputs : this.inputs);
    });
  }

  hide(clear: boolean): void {
    this.leave();
    if (clear) {
      this.ownClock.empty();
      this.live.notifyInputs([]);
    }
    if (this.#isIn) this.core!.sources.left(clear);
  }

  /** Removes the source from the world, before its splats are freed or shown elsewhere. Its clock stops meanwhile. */
  leave(): void {
    this.ownClock.suspend();
    this.member?.remove();
    this.member = undefined;
  }

  loadStarted(): void {
    this.element.dispatchEvent(new Event('loadstart'));
  }

  progressed(...[loaded, total, share = total ? loaded / total : undefined]: Parameters<ProgressListener>): void {
    this.#bytes = [loaded, total];
    this.progress = share === undefined ? null : Math.min(1, share);
    this.core?.element.requestUpdate();
    this.element.dispatchEvent(
      new ProgressEvent('progress', { lengthComputable: total !== undefined, loaded, total: total ?? 0 }),
    );
  }

  previewShown({ gaussians }: LoadedGaussians): void {
    this.element.dispatchEvent(new CustomEvent('preview', { detail: { splats: gaussians.count } }));
    this.progressed(...this.#bytes);
  }

  loaded(url: string): void {
    this.notifyLoaded(url);
    this.update();
    this.core?.sources.settledOne();
  }

  notifyLoaded(url: string): void {
    for (const type of ['loadeddata', ...PLAYABLE] as const) this.element.dispatchEvent(new Event(type));
    this.element.dispatchEvent(new CustomEvent('load', { detail: { url } }));
  }

  notifyFailed(error: ElementError): void {
    this.element.dispatchEvent(new CustomEvent('error', { detail: error }));
  }

  emptied(): void {
    this.#source.needNow(false);
    this.progress = null;
    this.#hasBegun = this.#isForNext;
    this.ownClock.empty();
    this.ownClock.stopWaits();
    this.element.dispatchEvent(new Event('emptied'));
    // The other sources count as restored: the scene that replaces this one reports its own loss.
    if (!this.#isOwn || this.scene.state === 'empty') this.contextChanged('contextrestored');
    // The others may move without this one.
    this.core?.sources.changed();
  }

  failed(error: ElementError): void {
    this.progress = null;
    console.error(`<${this.element.localName}>: ${error.message}`);
    this.notifyFailed(error);
    this.core?.sources.settledOne();
  }

  contextChanged(type: 'contextlost' | 'contextrestored'): void {
    this.core?.sources.contextChanged(type, this);
  }

  get #isOwn(): boolean {
    return this.core?.sources.ownEntry === this;
  }

  #updateDetail(): void {
    this.#detail.value?.update(this.#isIn && this.scene.state === 'ready' ? this.scene.scene : null);
  }

  readonly #warnOf = ({ message }: Error): void => this.owner.warn(message);

  #seenFrom(camera: Camera): Camera {
    return this.owner.seenFrom?.(camera, this.member, this.core!) ?? camera;
  }
}
