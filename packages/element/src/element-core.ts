import { Lazy, type Camera } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import type { ReactiveControllerHost } from 'lit';
import type { Attributes } from './attributes.js';
import { Behaviors, type BehaviorHost } from './behaviours.js';
import type { CameraAction } from './camera/gestures.js';
import type { ViewerFrame } from './camera/orbit.js';
import { frameOf } from './camera/settings.js';
import type { PickedPoint } from './camera/values.js';
import { CameraController } from './controllers/camera-controller.js';
import type { HotspotHost } from './controllers/hotspot-controller.js';
import type { InputHost, InputOptions } from './controllers/input-controller.js';
import { prefersReducedMotion } from './controllers/motion.js';
import type { PlaybackController } from './controllers/playback-controller.js';
import { RevealController, type RevealHost } from './controllers/reveal-controller.js';
import { SizeController, windowOf } from './controllers/size-controller.js';
import { ViewController, type ViewHost } from './controllers/view-controller.js';
import { VisibilityController } from './controllers/visibility-controller.js';
import type { EffectsHost } from './effects/effects.js';
import type { CameraChangeSource, GaussianSplatEventMap } from './events.js';
import { isGone } from './gpu/device-failures.js';
import { FrameScheduler } from './gpu/frame-scheduler.js';
import type { LoadedGaussians } from './gpu/loaded-gaussians.js';
import { defaultMemoryBudget } from './gpu/memory-budget.js';
import type { LodSettings, Drawable, ReadCounts } from './gpu/backend.js';
import type { SceneRequest } from './loading/protocol.js';
import type { Frame } from './dynamic/frame-filter.js';
import type { GeneratorInput } from './dynamic/inputs.js';
import type { SoundHost } from './dynamic/sound.js';
import type { DynamicWiring } from './dynamic/dynamic-wiring.js';
import type { QueryHost } from './position-from-point.js';
import { SourceEntry, type SourceOwner } from './source-entry.js';
import { SourceList } from './source-list.js';
import type { Services, ElementHost } from './element-host.js';
import { statsOf, type SceneStats } from './stats.js';
import type { TemplateModel } from './template.js';
import type { TourHost } from './views/tour.js';
import type { A11yStrings } from './words.js';

/**
 * Connects the source list, camera, size, visibility and input of an element behind its attributes and markup. It
 * implements the host interface of each controller.
 */
export class ElementCore
  implements SourceOwner, ViewHost, RevealHost, HotspotHost, InputHost, BehaviorHost, QueryHost, TourHost
{
  readonly element: ReactiveControllerHost & HTMLElement;
  readonly camera: CameraController;
  /** The element's own source and those of its children. */
  readonly sources: SourceList;
  readonly reveal: RevealController;
  readonly behaviors: Behaviors;
  readonly size: SizeController;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  drawnFrom: Camera | undefined;
  /** Called after each frame, in the task that has drawn it. */
  declare onFrame: (() => void) | undefined;
  readonly view: ViewController;
  readonly hasOwnClock = true;
  readonly #host: ElementHost;
  readonly #visibility: VisibilityController;
  #counts: ReadCounts | undefined;
  #children: MutationObserver | undefined;

  /** The state shown in the markup has changed. */
  readonly #update = (): void => this.element.requestUpdate();

  // Loaded on demand: few pages need these.

  /** Shows the element's children. */
  readonly #composition = new Lazy('the code that shows several scenes', async () => {
    const { compose } = await import('./composition/compose.js');
    compose(this);
    return true;
  });
  /** Flies between views. */
  readonly tour = new Lazy(
    'the code for views',
    async () => {
      const [{ Tour }] = await Promise.all([import('./views/tour.js'), this.behaviors.announcer.get()]);
      return new Tour(this.element, this);
    },
    this.#update,
  );
  /** Walks on the floor. */
  readonly walk = new Lazy(
    'the code for walking',
    async () => {
      const { WalkController } = await import('./walk/walk-controller.js');
      const walk = new WalkController(this.element, this);
      this.behaviors.add(walk);
      return walk;
    },
    this.#update,
  );
  /** VR, AR, the ruler, the shadow and the sky. */
  readonly extras = new Lazy(
    'the code for VR, AR and measuring',
    async () => new (await import('./xr/extras.js')).Extras(this.element, this),
    this.#update,
  );
  /** An `<audio>` or `<video>` element of the page that plays along with a moving scene. */
  readonly #sound = new Lazy('the code for sound', async () => {
    const { Sound } = await import('./dynamic/sound.js');
    const sound = new Sound(this.element as unknown as SoundHost);
    sound.update();
    return sound;
  });
  /** Cuts, the reveal effect, and the page's own shader. */
  readonly effects = new Lazy(
    'the code of effects',
    async () => new (await import('./effects/effects.js')).Effects(this as unknown as EffectsHost),
    this.#update,
  );
  /** A session shows the scene, so the page does not draw it. */
  isImmersed = false;
  /** Draws the frame for printing; fetched after the first frame. */
  readonly #print = new Lazy('the code for printing', async () => {
    const { PrintController } = await import('./controllers/print-controller.js');
    return new PrintController(this.element, () => this.drawNow());
  });
  /** Labels of the page. */
  readonly labels = new Lazy(
    'the code of labels',
    async () => {
      const { HotspotController } = await import('./controllers/hotspot-controller.js');
      const labels = new HotspotController(this.element, this);
      if (this.drawnFrom) labels.frameDrawn(this.drawnFrom);
      return labels;
    },
    this.#update,
  );
  /** Listens to mouse, touch and keyboard. */
  readonly #hands = new Lazy(
    'the code for mouse, touch and keys',
    async () => {
      const { handsView, InputController, PromptController } = await import('./controllers/input-controller.js');
      await this.behaviors.announcer.get();
      this.behaviors.promptBy(new PromptController(this.element, this.behaviors));
      this.handsView = handsView;
      return new InputController(this.element, this);
    },
    this.#update,
  );
  /** Set while input is enabled. */
  handsView: TemplateModel['handsView'];

  constructor(element: ReactiveControllerHost & HTMLElement, host: ElementHost) {
    this.element = element;
    this.#host = host;
    this.camera = new CameraController(host.attributes.camera, () => this.requestFrame());
    this.#visibility = new VisibilityController(element, () => this.#onVisibility());
    this.size = new SizeController(
      element,
      () => this.canvas,
      () => this.#onSize(),
    );
    this.view = new ViewController(this);
    this.sources = new SourceList(this, new SourceEntry(this, this));
    this.reveal = new RevealController(element, this);
    this.behaviors = new Behaviors(element, this);
    const onPageVisibility = (): void => this.sources.suspend();
    element.addController({
      hostConnected: () => {
        document.addEventListener('visibilitychange', onPageVisibility);
        this.#children ??= new MutationObserver(() => this.#lookAtChildren());
        this.#children.observe(element, { childList: true, subtree: true, attributeFilter: ['slot', 'data-orbit'] });
        this.#lookAtChildren();
        // An eager element that is inserted again after a while reloads even if it is not in view.
        this.sources.request();
      },
      hostUpdated: () => this.#updated(),
      hostDisconnected: () => {
        document.removeEventListener('visibilitychange', onPageVisibility);
        this.#children?.disconnect();
      },
    });
  }

  // Current attributes of the page.

  get attributes(): Attributes {
    return this.#host.attributes;
  }

  get services(): Services {
    return this.#host.services;
  }

  get source(): ElementHost['source'] {
    return this.#host.source;
  }

  get dynamicValues(): ElementHost['dynamicValues'] {
    return this.#host.dynamicValues;
  }

  get strings(): A11yStrings {
    return this.#host.strings;
  }

  get input(): InputOptions {
    const { cameraControls: enabled, disableZoom, disablePan, disableTap, touchAction, zoom: wheel } = this.attributes;
    return { enabled, zoom: !disableZoom, pan: !disablePan, tap: !disableTap, touchAction, wheel };
  }

  get decayMs(): number {
    return prefersReducedMotion() ? 0 : this.attributes.interpolationDecay;
  }

  get memoryBudget(): number | undefined {
    return this.services.memoryBudget ?? defaultMemoryBudget();
  }

  get scheduler(): FrameScheduler {
    return FrameScheduler.of(windowOf(this.element));
  }

  get canvas(): HTMLCanvasElement | null {
    return this.#host.part<HTMLCanvasElement>('canvas');
  }

  get surface(): HTMLElement | null {
    return this.#host.part('#view');
  }

  get hotspotLayer(): HTMLElement | null {
    return this.#host.part('#hotspots');
  }

  warn(sentence: string): void {
    this.#host.warn(sentence);
  }

  dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void {
    this.element.dispatchEvent(event);
  }

  // Interface of scripts.

  /** The clock of the element. */
  get playback(): PlaybackController {
    return this.sources.ownEntry.ownClock;
  }

  get live(): DynamicWiring {
    return this.sources.ownEntry.live;
  }

  /** Loads again the scenes that were released out of view. */
  present(): Promise<unknown> {
    return Promise.all(this.sources.entries.map(({ scene }) => scene.present()));
  }

  /** Draws a frame now and returns its canvas, to be read within the same task; null if there is nothing to draw. */
  drawNow(...image: Parameters<ViewController['drawNow']>): HTMLCanvasElement | null {
    return this.sources.ownEntry.scene.isPreview ? null : this.view.drawNow(...image);
  }

  /** Frames the scene again, as after loading; the scene of a generator is measured first. */
  async updateFraming(): Promise<void> {
    const { scene } = this.sources.ownEntry.scene;
    const bounds = await this.sources.readBounds();
    if (bounds && this.sources.ownEntry.scene.scene === scene) this.camera.frame(bounds);
  }

  /** Statistics of the displayed scene; null if there is none. */
  get stats(): SceneStats | null {
    const { shown, isPreview, levels, stats: parts } = this.sources;
    if (shown.length === 0) return null;
    return statsOf(shown, {
      quality: this.attributes.quality,
      dynamicQuality: this.view.dynamicQuality,
      counts: this.#counts,
      isPreview,
      frameBytes: this.view.backend?.byteLength ?? 0,
      pixelShare: this.view.backend?.pixelShare,
      pixels: levels.detail,
      parts,
    });
  }

  /** Reads the counts of the current image back from the GPU. */
  async updateStats(): Promise<SceneStats | null> {
    const { backend } = this.view;
    const camera = this.drawnFrom;
    if (backend === null || camera === undefined) return this.stats;
    try {
      const counts = await backend.readCounts(camera);
      if (this.view.backend === backend) this.#counts = counts;
    } catch (error) {
      // The renderer was replaced meanwhile; the other statistics do not need it.
      if (!(await isGone(backend))) throw error;
    }
    return this.stats;
  }

  /** Inputs of the displayed models that the page may set. */
  get inputs(): readonly GeneratorInput[] {
    return [...this.sources.ownEntry.inputs, ...(this.view.backend?.filter?.inputs ?? [])];
  }

  /** Seeks the clock of the displayed scene, or of the next one if the page requests another. */
  seek(seconds: number): void {
    if (this.sources.ownEntry.isLeaving) this.playback.startNextAt(seconds);
    else this.playback.currentTime = seconds;
  }

  /** Playback is requested: dismisses the poster and loads a scene that is out of view. */
  prepareToPlay(): void {
    this.sources.ownEntry.needNow();
    if (!this.reveal.mayReveal) this.reveal.dismiss();
    this.element.requestUpdate();
  }

  /** The element's earlier document no longer has a window. */
  leaveWindowless(): void {
    this.view.renewCanvas();
  }

  /** The visible surface under a point of the page: see the element's method of this name. */
  async positionFromPoint(clientX: number, clientY: number): Promise<PickedPoint | null> {
    const { positionFromPoint } = await queries.get();
    return positionFromPoint(this, clientX, clientY);
  }

  /** Fulfills, and never rejects, when nothing is pending, including code for attributes and children. */
  get settled(): Promise<unknown> {
    const code = [this.#print, this.#composition, this.effects, this.labels, this.#hands].map(({ settled }) => settled);
    return Promise.all(code).then(() => this.sources.settled);
  }

  // Interfaces of the controllers.

  get isVisible(): boolean {
    return this.#visibility.isVisible && !this.isImmersed;
  }

  /** Whether previews are of use: an eager load begins before it is known whether the element is in view. */
  get wantsPreviews(): boolean {
    return !this.#visibility.isKnownHidden;
  }

  /** The scene would be visible. */
  get isInSight(): boolean {
    return this.isVisible && this.reveal.mayReveal;
  }

  /** The scene is shown, in view, and not covered by a poster. */
  get isOnShow(): boolean {
    return !this.reveal.isCovered && this.isVisible;
  }

  /** Automatic motion is allowed. */
  get mayMove(): boolean {
    return this.isOnShow && !prefersReducedMotion() && !this.behaviors.motion.value?.isHeld;
  }

  /** A touch user has moved the camera and has no Home key. */
  get offersReset(): boolean {
    return this.input.enabled && this.isOnShow && this.#hands.value?.isTouch === true && this.camera.isTouched;
  }

  get hasImage(): boolean {
    return this.sources.hasImage;
  }

  get player(): BehaviorHost['player'] {
    return this.effects.value?.playerWith(this.sources.player) ?? this.sources.player;
  }

  get world(): SourceList['world'] {
    return this.sources.world;
  }

  get shown(): readonly LoadedGaussians[] {
    return this.sources.shown;
  }

  get levels(): LodSettings {
    return this.sources.levels;
  }

  /** The camera before the image has a size. */
  get firstView(): Camera {
    return this.camera.view(...FIRST_SIZE);
  }

  /** Rotation from the world, the frame of the element's own scene, to viewer space. */
  get frame(): ViewerFrame {
    return frameOf(this.attributes, { up: this.sources.ownEntry.member?.scene.bounds.up });
  }

  /** The request of a scene that has a file with a floor; null while there is none. */
  get walkable(): SceneRequest | null {
    const { scene } = this.sources.ownEntry;
    return scene.state === 'ready' && !scene.scene?.live ? scene.shownRequest : null;
  }

  prepareFrame(): string {
    this.sources.place();
    this.effects.value?.prepareFrame();
    const { layout, changes, placements } = this.sources.world;
    const versions = placements.map(({ scene }) => scene.version).join();
    return `${layout} ${changes} ${versions} ${this.sources.meshes.value?.version ?? ''}`;
  }

  drawBeneath(frame: Frame): Partial<FrameTarget> {
    return { ...this.extras.value?.sky.value?.draw(frame), ...this.sources.meshes.value?.draw(frame) };
  }

  /** Reads surface positions of the last frame. Rejects if the frame is gone. */
  async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    const answers = (await this.view.backend?.probe(points)) ?? [];
    return this.sources.meshes.value?.probe(points, answers) ?? answers;
  }

  // Notifications of the controllers.

  /** Requests a frame: a changed attribute may affect the image, such as its pixel ratio. */
  requestFrame(): void {
    this.view.requestFrame();
  }

  beforeFrame(now: number): void {
    this.behaviors.advance(now);
  }

  advanceScene(camera: Camera, now: number): void {
    this.sources.advance(camera, now);
  }

  afterFrame(camera: Camera): void {
    this.drawnFrom = camera;
    this.labels.value?.frameDrawn(camera);
    this.onFrame?.();
  }

  cameraChanged(source: CameraChangeSource): void {
    this.behaviors.announcer.value?.cameraMoved();
    this.dispatch(new CustomEvent('camera-change', { detail: { source } }));
  }

  /** The set of drawn splats has changed. */
  splatsChanged(): void {
    this.#counts = undefined;
    this.view.requestFrame();
    this.element.requestUpdate();
  }

  reportMotionFrame(isWhole: boolean): void {
    this.sources.reportMotionFrame(isWhole);
  }

  drawingFailed(error: unknown): void {
    this.sources.fail(error);
  }

  /** Prepares effects and settings of a scene before its first frame. */
  async prepareFor(scene: LoadedGaussians): Promise<void> {
    await this.effects.settled;
    await this.effects.value?.prepareFor(scene);
  }

  /** Draws the world from now on. Fulfills with its first frame. */
  draw(scene: Drawable): Promise<void> {
    this.#print.get().catch(this.#warnOf);
    const drawn = this.view.show(scene);
    this.live.attachPost(this.view.backend);
    return drawn;
  }

  /** Stops drawing; the last image stays unless it is to be cleared. */
  stopDrawing(clear: boolean): void {
    this.live.attachPost(null);
    if (!clear) return this.view.pause();
    this.drawnFrom = undefined;
    this.labels.value?.forget();
    this.view.clear();
  }

  posterDismissed(): void {
    this.dispatch(new Event('poster-dismissed'));
    this.sources.ownEntry.hasBegun = false;
    this.sources.startPlaying();
  }

  act(action: CameraAction): boolean {
    return this.behaviors.act(action);
  }

  /** A pick beside the scene means that the visitor has lost it. */
  pick(clientX: number, clientY: number): void {
    // A click while walking selects a destination.
    if (this.attributes.navigation === 'walk') return;
    this.positionFromPoint(clientX, clientY).then((point) => {
      if (point === null) this.act({ type: 'reset' });
      else if (this.input.pan) this.behaviors.aimAt([point.x, point.y, point.z]);
    }, this.#warnOf);
  }

  /** Toggles all motion, for the space bar. A player's controls around the element have keys of their own. */
  toggleMotion(): boolean {
    if (this.behaviors.motion.value?.toggle()) return true;
    if (!this.playback.canPlay || this.element.slot === 'media') return false;
    if (this.playback.paused) this.playback.play();
    else this.playback.pause();
    return true;
  }

  readonly #warnOf = (error: Error): void => this.warn(error.message);

  /** Loads the code for children on demand: few pages have any. */
  #lookAtChildren(): void {
    const has = (selector: string): boolean => this.element.querySelector(`:scope>:is(${selector})`) !== null;
    if (has('splat-scene,splat-mesh')) this.#composition.want(this.#warnOf);
    if (this.element.querySelector('splat-cut')) this.effects.want(this.#warnOf);
    if (has('[slot^=hotspot-]')) this.labels.want(this.#warnOf);
    if (has('[slot=sound]')) this.#sound.want(this.#warnOf);
    this.#sound.value?.update();
    if (has('[data-orbit]')) this.tour.want(this.#warnOf);
    if (this.tour.value) this.element.requestUpdate();
  }

  #updated(): void {
    this.sources.ownEntry.update();
    this.live.wantPost(this.sources.ownEntry.postprocess);
    if (!this.sources.ownEntry.isLeaving) this.playback.keepScene();
    if (this.attributes.views) this.tour.want(this.#warnOf);
    if (this.attributes.navigation === 'walk') this.walk.want(this.#warnOf);
    const { vr, ar, measure, shadowIntensity, skyboxImage, revealEffect } = this.attributes;
    if (revealEffect || this.source.splatShader) this.effects.want(this.#warnOf);
    if (vr || ar || measure || shadowIntensity || skyboxImage) this.extras.want(this.#warnOf);
    if (this.input.enabled) this.#hands.want(this.#warnOf);
    this.reveal.settle();
    this.sources.request();
  }

  #onVisibility(): void {
    this.sources.request();
    if (!this.isVisible) this.sources.suspend();
    this.dispatch(new CustomEvent('model-visibility', { detail: { visible: this.isVisible } }));
    this.element.requestUpdate();
    this.view.requestFrame();
  }

  #onSize(): void {
    // Without a size, for example in a background tab, the aspect ratio stays.
    if (!this.size.isEmpty) this.camera.setAspect(this.size.aspect);
    this.view.requestFrame();
  }
}

const queries = new Lazy('the code that finds points of the scene', () => import('./position-from-point.js'));

/**
 * Width and height, in pixels, passed to a generator before the image has a size: the default size of an element
 * without style.
 */
const FIRST_SIZE = [300, 150] as const;
