import type { Camera, Matrix4 } from '@gaussian-splat/core';
import type { Attributes } from '../attributes.js';
import { frameOf } from '../camera/settings.js';
import { DetailController, type DetailHost } from '../controllers/detail-controller.js';
import { PlaybackController, type PlaybackEvent, type PlaybackHost } from '../controllers/playback-controller.js';
import { SceneController, type Entrance, type SceneHost, type SceneState } from '../controllers/scene-controller.js';
import { SourceController, type SourceHost } from '../controllers/source-controller.js';
import type { ElementError } from '../errors.js';
import type { GaussianSplatEventMap } from '../events.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { GeneratorInput } from '../live/inputs.js';
import { LiveWiring, type LiveHost } from '../live/live-wiring.js';
import type { ProgressListener } from '../loading/protocol.js';
import type { Services } from '../stage-host.js';
import type { Stage } from '../stage.js';
import type { PartStats } from '../stats.js';
import type { Member } from '../member.js';
import type { Composition } from './composition.js';
import { costOf, type Part } from './part.js';
import { cameraInScene, isSolid, sceneToWorld } from './placing.js';
import type { SplatChild } from './child.js';

/** What a slot needs once it belongs to nothing any more. */
const NO_SERVICES = { releaseDelay: 0 } as Services;

/** The scene of a `<splat-scene>`: its life is that of an element's own scene, with a clock and generators of its own. */
export class SceneSlot implements Part, SceneHost, SourceHost, PlaybackHost, LiveHost, DetailHost {
  readonly scene: SceneController;
  readonly ownClock: PlaybackController;
  progress: number | null = null;
  hasBegun = false;
  readonly element: SplatChild;
  readonly #source: SourceController;
  readonly #live: LiveWiring;
  readonly #detail: DetailController;
  #composition: Composition | null = null;
  /** Of the element that it belonged to last. */
  #stage: Stage | undefined;
  member: Member | undefined;

  constructor(element: SplatChild) {
    this.element = element;
    this.ownClock = new PlaybackController(this);
    this.#live = new LiveWiring(this);
    this.scene = new SceneController(element, this);
    this.#source = new SourceController(this);
    this.#detail = new DetailController(this);
  }

  // What the composition asks.

  get state(): SceneState {
    return this.scene.state;
  }

  get error(): ElementError | null {
    return this.scene.error;
  }

  get settled(): Promise<void> {
    return this.scene.settled;
  }

  get source(): LoadedGaussians | null {
    return this.scene.scene;
  }

  get isEntered(): boolean {
    return this.member !== undefined;
  }

  get isShown(): boolean {
    return this.member !== undefined && (this.scene.state === 'ready' || this.scene.isPreview);
  }

  get isPreview(): boolean {
    return this.scene.isPreview;
  }

  get autoplays(): boolean {
    return this.element.autoplay;
  }

  get hasOwnClock(): boolean {
    return this.element.hasOwnClock;
  }

  get playback(): PlaybackController {
    return this.hasOwnClock || this.#stage === undefined ? this.ownClock : this.#stage.playback;
  }

  get duration(): number {
    return this.scene.scene?.live?.duration ?? NaN;
  }

  get url(): string {
    return this.scene.url;
  }

  get stats(): PartStats {
    const { state, error, scene } = this.scene;
    return { element: this.element, state, error, ...costOf(scene) };
  }

  get inputs(): readonly GeneratorInput[] {
    return this.member?.scene.live?.inputs ?? [];
  }

  get owner(): Element | null {
    return this.#composition?.stage.element ?? null;
  }

  attach(composition: Composition | null): void {
    if (composition === this.#composition) return this.update();
    this.#composition?.remove(this);
    this.#composition = composition;
    if (composition === null) return;
    this.#stage = composition.stage;
    composition.add(this);
    this.update();
    // It may have been moved within the page, and comes with what it has loaded.
    const { scene } = this.scene;
    if (scene && !scene.isLost) void this.show(scene, 'again').catch((error: unknown) => this.scene.fail(error));
  }

  request(): void {
    if (this.#composition) this.#source.request();
  }

  update(): void {
    if (this.#composition === null) return;
    this.#source.set(this.element.source);
    this.#detail.update(this.scene.state === 'ready' ? this.scene.scene : null);
    this.autoplay();
    this.requestFrame();
    this.#stage!.element.requestUpdate();
  }

  reload(): void {
    this.scene.want(null, false);
    this.#source.renew();
    this.update();
  }

  autoplay(): void {
    const { ownClock: clock } = this;
    if (this.autoplays && !this.hasBegun && clock.canPlay && this.#composition?.mayAutoplay) clock.play();
  }

  place(): void {
    if (this.member === undefined || this.#composition === null) return;
    const { bounds } = this.member.scene;
    const { placed, up, opacity, crop, hidden } = this.element.place;
    const { placement } = this.member;
    const isSeen = !hidden && isSolid(placed);
    if (isSeen) placement.sceneToWorld = sceneToWorld(this.#composition.frame, placed, frameOf({ up }, bounds));
    placement.opacity = opacity;
    placement.crop = crop;
    placement.visible = isSeen;
  }

  advance(camera: Camera, now: number): void {
    const scene = this.member?.scene;
    if (!scene?.live || this.scene.isOutgoing) return;
    this.#live.advance(scene, this.#seenFrom(camera), now);
  }

  fail(error: unknown): void {
    this.scene.fail(error);
  }

  notePace(isWhole: boolean): void {
    this.#detail.notePace(isWhole);
  }

  // What the controllers ask.

  get attributes(): Attributes {
    const { attributes } = this.#stage!;
    const crossorigin = this.element.crossorigin === null ? attributes.crossorigin : this.element.credentials;
    return { ...attributes, crossorigin };
  }

  get services(): Services {
    return this.#stage?.services ?? NO_SERVICES;
  }

  get isInSight(): boolean {
    return this.#stage!.isInSight;
  }

  get isConnected(): boolean {
    return this.#composition !== null && this.#stage!.isConnected;
  }

  get wantsPreviews(): boolean {
    return this.#stage!.wantsPreviews;
  }

  get memoryBudget(): number | undefined {
    return this.#stage!.memoryBudget;
  }

  get loops(): boolean {
    return this.hasOwnClock ? this.element.loop : this.#stage!.loops;
  }

  readonly startTime = 0;
  readonly shown = [];

  get liveValues(): LiveHost['liveValues'] {
    return this.element.liveValues;
  }

  get liveRequest(): SceneHost['liveRequest'] {
    const stage = this.#stage!;
    return {
      element: this.element,
      runtimeLocation: this.services.runtimeLocation,
      loader: this.services.sceneLoader,
      state: () => this.#live.state,
      ownsControls: () => !stage.live.post.isWanted,
      camera: () => this.#seenFrom(stage.firstView),
      listeners: this.#live.listeners,
    };
  }

  // What they tell.

  requestFrame(): void {
    this.#stage?.requestFrame();
  }

  splatsChanged(): void {
    this.#stage?.splatsChanged();
  }

  warn(sentence: string): void {
    this.element.warn(sentence);
  }

  dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void {
    this.element.dispatchEvent(event);
  }

  playbackEvent(type: PlaybackEvent): void {
    this.dispatch(new Event(type));
    if (type !== 'play' && type !== 'pause') return;
    this.hasBegun ||= type === 'play';
    this.#stage?.element.requestUpdate();
  }

  async show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    this.ownClock.setDuration(scene.live?.duration ?? NaN);
    await this.#composition?.join(this, scene, entrance, (member) => {
      this.member?.remove();
      this.member = member;
      this.place();
      this.#live.tellInputs(this.inputs);
    });
  }

  hide(clear: boolean): void {
    this.leave();
    this.ownClock.suspend();
    if (clear) this.ownClock.empty();
    this.#composition?.left(clear);
  }

  /** Out of the world: its splats are about to go, or to be shown elsewhere. */
  leave(): void {
    this.member?.remove();
    this.member = undefined;
    this.#live.tellInputs(this.inputs);
  }

  previewShown({ gaussians }: LoadedGaussians): void {
    this.dispatch(new CustomEvent('preview', { detail: { splats: gaussians.count } }));
    this.#stage?.element.requestUpdate();
  }

  loadStarted(): void {
    this.dispatch(new Event('loadstart'));
  }

  progressed(...[loaded, total, share = total ? loaded / total : undefined]: Parameters<ProgressListener>): void {
    this.progress = share === undefined ? null : Math.min(1, share);
    this.#stage?.element.requestUpdate();
    this.dispatch(new ProgressEvent('progress', { lengthComputable: total !== undefined, loaded, total: total ?? 0 }));
  }

  loaded(url: string): void {
    this.dispatch(new CustomEvent('load', { detail: { url } }));
    this.update();
    this.#composition?.partSettled();
  }

  emptied(): void {
    this.progress = null;
    this.hasBegun = false;
    this.ownClock.empty();
    this.ownClock.stopWaits();
    this.dispatch(new Event('emptied'));
    this.contextChanged('contextrestored');
  }

  failed(error: ElementError): void {
    this.progress = null;
    this.dispatch(new CustomEvent('error', { detail: error }));
    this.contextChanged('contextrestored');
    this.#composition?.partSettled();
  }

  contextChanged(type: 'contextlost' | 'contextrestored'): void {
    if (this.#composition?.tellsContext(type, this)) this.#stage?.dispatch(new Event(type));
  }

  /** A camera of the world, as this scene sees it. */
  #seenFrom(camera: Camera): Camera {
    const matrix = this.member?.placement.sceneToWorld ?? this.#toWorld();
    return matrix && isSolid(matrix) ? cameraInScene(camera, matrix) : camera;
  }

  /** Where it will stand, before anything is known of it. */
  #toWorld(): Matrix4 | undefined {
    if (this.#composition === null) return undefined;
    const { placed, up } = this.element.place;
    return sceneToWorld(this.#composition.frame, placed, frameOf({ up }, {}));
  }
}
