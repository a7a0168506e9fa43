import { Lazy, type Camera } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import type { Attributes } from './attributes.js';
import { Behaviors, type BehaviorHost } from './behaviors.js';
import type { ViewerFrame } from './camera/orbit.js';
import { frameOf } from './camera/settings.js';
import type { PickedPoint } from './camera/values.js';
import { CameraController } from './camera-controller.js';
import type { HotspotHost } from '../features/labels/hotspot-controller.js';
import type { InputHost, InputOptions } from '../features/input/input-controller.js';
import { prefersReducedMotion } from './motion.js';
import type { PlaybackController } from './playback-controller.js';
import { RevealController, type RevealHost } from './reveal-controller.js';
import { SizeController, windowOf } from './size-controller.js';
import { ViewController, type ViewHost } from './view-controller.js';
import { VisibilityController } from './visibility-controller.js';
import type { EffectsHost } from '../features/effects/effects.js';
import type { CameraChangeSource } from './events.js';
import { isGone } from '../gpu/device-failures.js';
import { FrameScheduler } from '../gpu/frame-scheduler.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { defaultMemoryBudget } from '../gpu/memory-budget.js';
import { wantHeadset } from '../gpu/request-device.js';
import type { Drawable, ReadCounts } from '../gpu/backend.js';
import type { SceneRequest } from '../loading/protocol.js';
import type { Frame } from '../sources/generator/frame-filter.js';
import type { GeneratorInput } from '../sources/generator/inputs.js';
import type { SoundHost } from '../features/sound/sound.js';
import type { DynamicHost, DynamicWiring } from '../sources/generator/dynamic-wiring.js';
import type { QueryHost } from './position-from-point.js';
import { SourceEntry, type SourceOwner } from './source-entry.js';
import { SourceList } from './source-list.js';
import type { Services, ElementHost } from './element-host.js';
import { statsOf, type SceneStats } from './stats.js';
import type { TemplateModel } from './template.js';
import { Features } from './features.js';
import type { TourHost } from '../features/views/tour.js';
import type { A11yStrings } from './strings.js';

/**
 * Core of an element, behind its attributes and markup: connects the source list, camera, size, visibility and input.
 * Implements the host interface of each controller.
 */
export class ElementCore
  implements SourceOwner, ViewHost, RevealHost, HotspotHost, InputHost, BehaviorHost, QueryHost, TourHost
{
  readonly element: SourceOwner['element'];
  readonly camera: CameraController;
  /** The element's own source and those of its children. */
  readonly sources: SourceList;
  readonly reveal: RevealController;
  readonly behaviors: Behaviors;
  readonly size: SizeController;
  /** The camera of the last frame, with the size of the frame in pixels; undefined before the first frame. */
  drawnFrom: Camera | undefined;
  /** Called after each frame, in the task that has drawn it. */
  declare onFrame: (() => void) | undefined;
  readonly view: ViewController;
  readonly hasOwnClock = true;
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
  readonly features = new Features(() => this.element.requestUpdate());
  /** Shows the element's children. */
  readonly #composition = this.features.add(
    'the code that shows several scenes',
    { children: ':scope>splat-scene,:scope>splat-mesh' },
    async () => {
      const { compose } = await import('../features/children/compose.js');
      compose(this);
      return {};
    },
  );
  /** Flies between views. */
  readonly tour = this.features.add(
    'the code for views',
    { by: ({ views }) => views, children: ':scope>[data-orbit]' },
    async () => {
      const [{ Tour }] = await Promise.all([import('../features/views/tour.js'), this.behaviors.announcer.get()]);
      return new Tour(this.element, this);
    },
  );
  /** Moves the camera on the floor. */
  readonly walk = this.features.add(
    'the code for walking',
    { by: ({ navigation }) => navigation === 'walk' },
    async () => new (await import('../features/walk/walk-controller.js')).WalkController(this.element, this),
  );
  /** VR, AR, the ruler, the shadow and the sky. */
  readonly extras = this.features.add(
    'the code for VR, AR and measuring',
    {
      by: ({ vr, ar, measure, shadowIntensity, skyboxImage }) => vr || ar || measure || shadowIntensity || skyboxImage,
    },
    async () => new (await import('../features/xr/extras.js')).Extras(this.element, this),
  );
  /** An `<audio>` or `<video>` element of the page that plays along with a moving scene. */
  readonly sound = this.features.add('the code for sound', { children: ':scope>[slot=sound]' }, async () => {
    const { Sound } = await import('../features/sound/sound.js');
    const sound = new Sound(this.element as unknown as SoundHost);
    sound.childrenChanged();
    return sound;
  });
  /** Cuts, the reveal effect, and the page's own shader. */
  readonly effects = this.features.add(
    'the code of effects',
    { by: ({ revealEffect }) => revealEffect || this.source.splatShader, children: 'splat-cut' },
    async () => new (await import('../features/effects/effects.js')).Effects(this as unknown as EffectsHost),
  );
  /** Whether a VR or AR session shows the scene. The page does not draw meanwhile. */
  isImmersed = false;
  /** Draws an image before the page is printed; its code is loaded with the first frame. */
  readonly #print = this.features.add('the code for printing', {}, async () => {
    const { PrintController } = await import('../features/print/print-controller.js');
    return new PrintController(this.element, () => this.drawNow());
  });
  /** Positions the hotspots: children in slots named `hotspot-…`. */
  readonly labels = this.features.add('the code of labels', { children: ':scope>[slot^=hotspot-]' }, async () => {
    const { HotspotController } = await import('../features/labels/hotspot-controller.js');
    const labels = new HotspotController(this.element, this);
    if (this.drawnFrom) labels.frameDrawn(this.drawnFrom);
    return labels;
  });
  /** Listens to mouse, touch and keyboard. */
  readonly #hands = this.features.add(
    'the code for mouse, touch and keys',
    { by: () => this.input.enabled },
    async () => {
      const { handsView, InputController, PromptController } = await import('../features/input/input-controller.js');
      await this.behaviors.announcer.get();
      this.behaviors.promptBy(new PromptController(this.element, this.behaviors));
      this.handsView = handsView;
      return new InputController(this.element, this);
    },
  );
  /** Template of the prompt, reset button and keyboard help; undefined until the code for input is loaded. */
  handsView: TemplateModel['handsView'];

  constructor(element: SourceOwner['element'], attributes: Attributes, host: ElementHost) {
    this.element = element;
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

  get hotspotLayer(): HTMLElement | null {
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
  async positionFromPoint(clientX: number, clientY: number): Promise<PickedPoint | null> {
    const { positionFromPoint } = await queries.get();
    return positionFromPoint(this, clientX, clientY);
  }

  /** Fulfills when no source is loading and no code for attributes or children is pending. Never rejects. */
  get settled(): Promise<unknown> {
    const code = [this.#print, this.#composition, this.effects, this.labels, this.#hands].map(({ settled }) => settled);
    return Promise.all(code).then(() => this.sources.settled);
  }

  // Properties that the controllers read.

  get isVisible(): boolean {
    return this.#visibility.isVisible && !this.isImmersed;
  }

  /** Whether a scene that loads may be shown in part: unless the element is known to be out of view. */
  get wantsPreviews(): boolean {
    return !this.#visibility.isKnownHidden;
  }

  /** Whether the scene would be visible if it were loaded, in the page or in a headset. */
  get isInSight(): boolean {
    return (this.isVisible || this.isImmersed) && this.reveal.mayReveal;
  }

  /** Whether the element is in view and no poster covers the scene. */
  get isOnShow(): boolean {
    return !this.reveal.isCovered && this.isVisible;
  }

  /**
   * Whether automatic motion is allowed: the scene is in view, and neither visitor nor system settings forbid motion.
   */
  get mayMove(): boolean {
    return this.isOnShow && !prefersReducedMotion() && !this.behaviors.motion.value?.isHeld;
  }

  /** Whether the reset button is offered: for touch users who have moved the camera, because they have no Home key. */
  get offersReset(): boolean {
    return this.input.enabled && this.isOnShow && this.#hands.value?.isTouch === true && this.camera.isTouched;
  }

  get player(): BehaviorHost['player'] {
    return this.effects.value?.playerWith(this.sources.player) ?? this.sources.player;
  }

  /** The camera at the default size of an element, for a generator that runs before the image has a size. */
  get firstView(): Camera {
    return this.camera.view(...FIRST_SIZE);
  }

  /** Rotation from the world to viewer space. The world has the frame of the element's own scene. */
  get frame(): ViewerFrame {
    return frameOf(this.attributes, { up: this.sources.ownEntry.member?.scene.bounds.up });
  }

  /**
   * Request of the displayed scene, whose file is searched for a floor; null while no scene is shown, and for one that
   * moves.
   */
  get walkable(): SceneRequest | null {
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
    this.behaviors.announcer.value?.cameraMoved();
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
    await this.effects.settled;
    await Promise.all(this.features.call('prepareFor', scene));
  }

  /** Starts to draw the world with the renderer of a scene. Fulfills with the first frame. */
  draw(scene: Drawable): Promise<void> {
    this.#print.get().catch(this.#warnOf);
    const drawn = this.view.show(scene);
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

  /**
   * Sets the orbit target to the surface under a click or tap, CSS pixels. Resets the camera if there is no surface,
   * because the visitor has then lost the scene.
   */
  pick(clientX: number, clientY: number): void {
    // A click while walking selects a destination.
    if (this.attributes.navigation === 'walk') return;
    this.positionFromPoint(clientX, clientY).then((point) => {
      if (point === null) this.behaviors.act({ type: 'reset' });
      else if (this.input.pan) this.behaviors.aimAt([point.x, point.y, point.z]);
    }, this.#warnOf);
  }

  /**
   * Pauses or resumes all automatic motion, for the space bar.
   * @returns Whether there is any; false also in slot `media`, because the player around the element has keys of its
   * own.
   */
  toggleMotion(): boolean {
    if (this.behaviors.motion.value?.toggle()) return true;
    if (!this.playback.canPlay || this.element.slot === 'media') return false;
    if (this.playback.paused) this.playback.play();
    else this.playback.pause();
    return true;
  }

  readonly #warnOf = (error: Error): void => this.warn(error.message);

  #lookAtChildren(): void {
    this.features.readChildren(this.element, this.#warnOf);
    if (this.tour.value) this.element.requestUpdate();
  }

  #updated(): void {
    this.sources.ownEntry.update();
    this.live.wantPost(this.sources.ownEntry.postprocess);
    if (this.attributes.vr) wantHeadset();
    this.features.readAttributes(this.attributes, this.#warnOf);
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
