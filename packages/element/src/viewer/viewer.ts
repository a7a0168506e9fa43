import { Lazy, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import type { Attributes, Navigation } from './attributes.js';
import type { Announcer } from './announcer.js';
import type { CameraAction } from './camera/gestures.js';
import type { ViewerFrame } from './camera/orbit.js';
import { frameOf } from './camera/settings.js';
import type { PickedPoint } from './camera/values.js';
import type { Aim } from './position-from-point.js';
import { CameraController } from './camera-controller.js';
import { Features, type FeatureTable } from './features.js';
import { prefersReducedMotion, reducedMotion } from './motion.js';
import type { PlaybackController, Player } from './playback-controller.js';
import { RevealController } from './reveal-controller.js';
import { SizeController, windowOf } from './size-controller.js';
import { ViewController } from './view-controller.js';
import { VisibilityController } from './visibility-controller.js';
import type { CameraChangeSource } from './events.js';
import { isGone } from '../gpu/device-failures.js';
import { FrameScheduler } from '../gpu/frame-scheduler.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { defaultMemoryBudget } from '../gpu/memory-budget.js';
import type { Drawable, ReadCounts } from '../gpu/backend.js';
import type { SceneRequest } from '../loading/protocol.js';
import type { Frame } from '../sources/generator/frame-filter.js';
import type { GeneratorInput } from '../sources/generator/inputs.js';
import type { DynamicHost, DynamicWiring } from '../sources/generator/dynamic-wiring.js';
import { SourceEntry, type SourceOwner } from './source-entry.js';
import { SourceList } from './source-list.js';
import type { Services, ElementHost, ViewerElement } from './element-host.js';
import { statsOf, type SceneStats } from './stats.js';
import type { A11yStrings } from './strings.js';

/** Interactions that the page allows. */
export interface InputOptions {
  readonly enabled: boolean;
  readonly zoom: boolean;
  readonly pan: boolean;
  /** Whether double clicks and double taps have an effect. */
  readonly tap: boolean;
  /** Condition under which the wheel zooms: see the attribute `zoom`. */
  readonly wheel: Attributes['zoom'];
  /** CSS `touch-action` of the frame: the one-finger gestures that are left to the page. */
  readonly touchAction: string;
}

/**
 * Core of an element, behind its attributes and markup: connects the source list, camera, size, visibility and features.
 * It is all of the element that a {@link Feature} knows.
 */
export class Viewer implements SourceOwner {
  readonly element: ViewerElement;
  readonly camera: CameraController;
  /** The element's own source and those of its children. */
  readonly sources: SourceList;
  readonly reveal: RevealController;
  readonly size: SizeController;
  /** The camera of the last frame, with the size of the frame in pixels; undefined before the first frame. */
  drawnFrom: Camera | undefined;
  /** Called after each frame, in the task that has drawn it. */
  declare onFrame: (() => void) | undefined;
  readonly view: ViewController;
  readonly hasOwnClock = true;

  /** Up direction that the page sets, in the axes of the file; undefined for that of the file. */
  get ownUp(): Vector3 | undefined {
    return this.attributes.up;
  }

  /** The clock of the element. */
  readonly playback: PlaybackController;
  readonly live: DynamicWiring;
  /** Current attributes of the page. */
  attributes: Attributes;
  /** Inputs of the page for generators, besides the time. */
  dynamicValues: DynamicHost['owner']['dynamicValues'] = { pose: undefined, controls: {}, images: {} };
  /** Texts that screen readers speak, in the language of the page. */
  strings: A11yStrings = {};
  readonly services: Services;
  readonly source: ElementHost['source'];
  readonly warn: ElementHost['warn'];
  readonly #part: ElementHost['part'];
  readonly #visibility: VisibilityController;
  #counts: ReadCounts | undefined;
  #children: MutationObserver | undefined;

  /** Capabilities whose code is loaded when a page uses them. */
  readonly features: Features;
  /** The live region that screen readers read aloud. */
  readonly announcer: Lazy<Announcer>;
  /** Whether something other than the page shows the scene, such as a headset. The page does not draw meanwhile. */
  isShownElsewhere = false;
  /** The navigation that the scene does not allow, for example without a floor. */
  #refused: Navigation | undefined;

  constructor(element: ViewerElement, features: FeatureTable, attributes: Attributes, host: ElementHost) {
    this.element = element;
    this.features = new Features(features, this);
    this.announcer = this.features.get('announcer');
    this.attributes = attributes;
    ({ services: this.services, source: this.source, part: this.#part, warn: this.warn } = host);
    this.camera = new CameraController(attributes.camera, () => this.requestFrame());
    this.#visibility = new VisibilityController(element, () => this.#onVisibility());
    this.size = new SizeController(
      element,
      () => this.canvas,
      () => this.#onSize(),
    );
    this.view = new ViewController(this);
    const own = new SourceEntry(this, this);
    ({ ownClock: this.playback, live: this.live } = own);
    this.sources = new SourceList(this, own);
    this.reveal = new RevealController(element, this);
    const onPageVisibility = (): void => this.sources.suspend();
    const onBlur = (): void => this.rest();
    let motion: MediaQueryList | undefined;
    const onMotion = (): void => element.requestUpdate();
    element.addController({
      hostConnected: () => {
        // `focusout` is fired also when the focus moves from the frame to a button in the shadow tree.
        element.shadowRoot?.addEventListener('focusout', onBlur);
        motion = reducedMotion();
        motion.addEventListener('change', onMotion);
        document.addEventListener('visibilitychange', onPageVisibility);
        this.#children ??= new MutationObserver(() => this.features.readChildren());
        const attributeFilter = ['slot', ...this.features.childAttributes];
        this.#children.observe(element, { childList: true, subtree: true, attributeFilter });
        this.features.readChildren();
        // An eager element that is inserted again after a while reloads even if it is not in view.
        this.sources.request();
      },
      hostUpdated: () => this.#updated(),
      hostDisconnected: () => {
        document.removeEventListener('visibilitychange', onPageVisibility);
        element.shadowRoot?.removeEventListener('focusout', onBlur);
        motion?.removeEventListener('change', onMotion);
        this.#children?.disconnect();
      },
    });
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
    return this.#part<HTMLCanvasElement>('canvas');
  }

  get surface(): HTMLElement | null {
    return this.#part('#view');
  }

  /** Contains a box for each slot of {@link Feature.slots}, in their order; null until it is rendered. */
  get slotLayer(): HTMLElement | null {
    return this.#part('#hotspots');
  }

  // Interface of scripts.

  /** Loads the scenes again that were released out of view. Fulfills when all are shown. */
  present(): Promise<unknown> {
    return Promise.all(this.sources.entries.map(({ scene }) => scene.present()));
  }

  /**
   * Draws a frame at once and returns its canvas, which must be read within the same task. null if there is nothing to
   * draw, or only a preview.
   */
  drawNow(...image: Parameters<ViewController['drawNow']>): HTMLCanvasElement | null {
    return this.sources.ownEntry.scene.isPreview ? null : this.view.drawNow(...image);
  }

  /** Moves the camera to frame the scene, as after loading. The bounds of a generator's splats are measured first. */
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

  /**
   * Reads the counts of the current image back from the GPU, then returns the statistics with these counts; null
   * without a scene.
   */
  async updateStats(): Promise<SceneStats | null> {
    const { backend } = this.view;
    const camera = this.drawnFrom;
    if (backend === null || camera === undefined) return this.stats;
    try {
      const counts = await backend.readCounts(camera);
      if (this.view.backend === backend) this.#counts = counts;
    } catch (error) {
      // If the renderer was replaced meanwhile, the counts are not updated; the other statistics do not depend on them.
      if (!(await isGone(backend))) throw error;
    }
    return this.stats;
  }

  /** Inputs of the displayed models that the page may set. */
  get inputs(): readonly GeneratorInput[] {
    return [...this.sources.ownEntry.inputs, ...(this.view.backend?.filter?.inputs ?? [])];
  }

  /** Prepares playback: dismisses the poster, and loads the scene even if it is out of view. */
  prepareToPlay(): void {
    this.sources.ownEntry.needNow();
    if (!this.reveal.mayReveal) this.reveal.dismiss();
    this.element.requestUpdate();
  }

  /** Returns the visible surface under a point of the page, in CSS pixels: see the element's method of this name. */
  async positionFromPoint(clientX: number, clientY: number, aim?: Aim): Promise<PickedPoint | null> {
    const { positionFromPoint } = await queries.get();
    return positionFromPoint(this, clientX, clientY, aim);
  }

  /** Fulfills when no source is loading and no code for attributes or children is pending. Never rejects. */
  get settled(): Promise<unknown> {
    return this.features.settled.then(() => this.sources.settled);
  }

  // Properties that the controllers read.

  get isVisible(): boolean {
    return this.#visibility.isVisible && !this.isShownElsewhere;
  }

  /** Whether a scene that loads may be shown in part: unless the element is known to be out of view. */
  get wantsPreviews(): boolean {
    return !this.#visibility.isKnownHidden;
  }

  /** Whether the scene would be visible if it were loaded, in the page or in a headset. */
  get isInSight(): boolean {
    return (this.isVisible || this.isShownElsewhere) && this.reveal.mayReveal;
  }

  /** Whether the element is in view and no poster covers the scene. */
  get isOnShow(): boolean {
    return !this.reveal.isCovered && this.isVisible;
  }

  /** Whether automatic motion is allowed: the scene is in view, and neither visitor nor system forbids it. */
  get mayMove(): boolean {
    return this.isOnShow && !prefersReducedMotion() && !this.features.call('mayMove').includes(false);
  }

  /** Plays and pauses all sources with `autoplay`, and what features play. Undefined if there is neither. */
  get player(): Player | undefined {
    return this.features.first('playerWith', this.sources.player) ?? this.sources.player;
  }

  /** How visitors move the camera: by the attribute, or in flight if the scene does not allow that. */
  get navigation(): Navigation {
    const { navigation } = this.attributes;
    return navigation === this.#refused ? 'fly' : navigation;
  }

  /** Called with a navigation that the scene does not allow; with undefined for a new scene. */
  refuseNavigation(refused: Navigation | undefined): void {
    if (refused === this.#refused) return;
    this.#refused = refused;
    this.element.requestUpdate();
  }

  /** The camera at the default size of an element, for a generator that runs before the image has a size. */
  get firstView(): Camera {
    return this.camera.view(...FIRST_SIZE);
  }

  /** Rotation from the world to viewer space. The world has the frame of the element's own scene. */
  get frame(): ViewerFrame {
    return frameOf(this.attributes, { up: this.sources.ownEntry.member?.scene.bounds.up });
  }

  /** Request of the displayed scene; null while no scene is shown, and for one that moves. */
  get stillRequest(): SceneRequest | null {
    const { scene } = this.sources.ownEntry;
    return scene.state === 'ready' && !scene.scene?.live ? scene.shownRequest : null;
  }

  prepareFrame(): string {
    this.sources.place();
    this.features.call('prepareFrame');
    const { layout, changes, placements } = this.sources.world;
    const versions = placements.map(({ scene }) => scene.version).join();
    return `${layout} ${changes} ${versions} ${this.sources.meshes.value?.version ?? ''}`;
  }

  drawBeneath(frame: Frame): Partial<FrameTarget> {
    return Object.assign({}, ...this.features.call('drawBeneath', frame), this.sources.meshes.value?.draw(frame));
  }

  /** Reads surface positions of the last frame. Rejects if the frame is gone. */
  async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    this.sources.place();
    const answers = (await this.view.backend?.probe(points)) ?? [];
    return this.sources.meshes.value?.probe(points, answers) ?? answers;
  }

  // Notifications of the controllers.

  /** Requests a frame. Called after each change that may affect the image, such as that of its pixel ratio. */
  requestFrame(): void {
    this.view.requestFrame();
  }

  afterFrame(camera: Camera): void {
    this.drawnFrom = camera;
    this.features.call('frameDrawn', camera);
    this.onFrame?.();
  }

  cameraChanged(source: CameraChangeSource): void {
    this.features.call('cameraMoved');
    this.element.dispatchEvent(new CustomEvent('camera-change', { detail: { source } }));
  }

  /** Requests a frame and discards the counts, because the set of drawn splats has changed. */
  splatsChanged(): void {
    this.#counts = undefined;
    this.view.requestFrame();
    this.element.requestUpdate();
  }

  /** Prepares effects and settings of a scene before its first frame. */
  async prepareFor(scene: LoadedGaussians): Promise<void> {
    await this.features.readyForFrames;
    await Promise.all(this.features.call('prepareFor', scene));
  }

  /** Starts to draw the world with the renderer of a scene. Fulfills with the first frame. */
  draw(scene: Drawable): Promise<void> {
    const drawn = this.view.show(scene);
    this.features.readAttributes();
    this.live.attachPost(this.view.backend);
    return drawn;
  }

  /** Stops drawing. `clear` also clears the canvas; otherwise the last image stays. */
  stopDrawing(clear: boolean): void {
    this.live.attachPost(null);
    if (!clear) return this.view.pause();
    this.drawnFrom = undefined;
    this.features.call('cleared');
    this.view.clear();
  }

  posterDismissed(): void {
    // WebKit leaves a canvas that becomes visible blank until it is drawn again.
    this.requestFrame();
    this.element.dispatchEvent(new Event('poster-dismissed'));
    this.sources.startPlaying();
  }

  /** Advances all automatic motions to the time of a frame, `now` in milliseconds. */
  advance(now: number): void {
    if (this.features.call('advance', now).includes(true)) this.requestFrame();
  }

  /** Applies a visitor's gesture or key. @returns Whether it has an effect; false only for a zoom beyond its limit. */
  act(action: CameraAction): boolean {
    const { isTouched } = this.camera;
    this.touched();
    const moves = this.features.first('act', action) ?? this.camera.act(action);
    // The reset button is shown only after the camera was touched.
    if (this.camera.isTouched !== isTouched) this.element.requestUpdate();
    return moves;
  }

  /** Call when a visitor moves the camera. */
  touched(): void {
    this.features.call('touched');
    this.rest();
  }

  /** Delays automatic motion, because the camera was moved. */
  rest(): void {
    this.features.call('rest');
  }

  /**
   * Sets the orbit target to the surface under a click or tap, CSS pixels. Resets the camera if there is no surface,
   * because the visitor has then lost the scene.
   */
  pick(clientX: number, clientY: number): void {
    if (this.features.first('pick', clientX, clientY)) return;
    this.positionFromPoint(clientX, clientY).then((point) => {
      if (point === null) this.act({ type: 'reset' });
      else if (this.input.pan) this.#aimAt([point.x, point.y, point.z]);
    }, this.warnOf);
  }

  #aimAt(point: Vector3): void {
    this.touched();
    this.camera.aimAt(point);
  }

  /**
   * Pauses or resumes all automatic motion, for the space bar.
   * @returns Whether there is any; false also in slot `media`, because the player around the element has keys of its
   * own.
   */
  toggleMotion(): boolean {
    if (this.features.first('toggleMotion')) return true;
    if (!this.playback.canPlay || this.element.slot === 'media') return false;
    if (this.playback.paused) this.playback.play();
    else this.playback.pause();
    return true;
  }

  readonly warnOf = (error: Error): void => this.warn(error.message);

  #updated(): void {
    this.sources.ownEntry.update();
    this.live.wantPost(this.sources.ownEntry.postprocess);
    this.camera.pivot = this.attributes.navigation === 'orbit' ? 'target' : 'eye';
    this.features.readAttributes();
    this.reveal.settle();
    this.sources.request();
  }

  #onVisibility(): void {
    this.sources.request();
    if (!this.isVisible) this.sources.suspend();
    this.element.dispatchEvent(new CustomEvent('model-visibility', { detail: { visible: this.isVisible } }));
    this.element.requestUpdate();
    this.view.requestFrame();
  }

  #onSize(): void {
    // Without a size, for example in a background tab, the aspect ratio stays, and no frame advances the clocks.
    if (this.size.isEmpty) this.sources.suspend();
    else this.camera.setAspect(this.size.aspect);
    this.view.requestFrame();
  }
}

const queries = new Lazy('the code that finds points of the scene', () => import('./position-from-point.js'));

/**
 * Width and height, in CSS pixels, that a generator gets before the image has a size: the default size of an element
 * without style.
 */
const FIRST_SIZE = [300, 150] as const;
