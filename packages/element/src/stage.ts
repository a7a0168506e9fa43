import { loadModule, type Camera } from '@gaussian-splat/core';
import { World, type ProbeAnswer, type ProbePoint } from '@gaussian-splat/renderer';
import type { ReactiveControllerHost } from 'lit';
import { Behaviours, type BehaviourHost } from './behaviours.js';
import type { CameraAction } from './camera/gestures.js';
import type { SceneBounds } from './camera/settings.js';
import { CameraController } from './controllers/camera-controller.js';
import { DetailController, type DetailHost } from './controllers/detail-controller.js';
import type { HotspotController, HotspotHost } from './controllers/hotspot-controller.js';
import type { InputController, InputHost } from './controllers/input-controller.js';
import { prefersReducedMotion } from './controllers/motion-controller.js';
import { PlaybackController, type PlaybackEvent, type PlaybackHost } from './controllers/playback-controller.js';
import { PrintController } from './controllers/print-controller.js';
import { RevealController, type RevealHost } from './controllers/reveal-controller.js';
import { SceneController, type Entrance, type SceneHost, type SceneState } from './controllers/scene-controller.js';
import { SizeController } from './controllers/size-controller.js';
import { SourceController, type SourceHost } from './controllers/source-controller.js';
import { ViewController, type ViewHost } from './controllers/view-controller.js';
import { VisibilityController } from './controllers/visibility-controller.js';
import { ElementCore } from './element-core.js';
import type { ElementError } from './errors.js';
import type { CameraChangeSource } from './events.js';
import { isGone } from './gpu/device-failures.js';
import type { DetailLevers, LoadedGaussians } from './gpu/loaded-gaussians.js';
import type { GeneratorInput } from './live/inputs.js';
import { Member } from './member.js';
import { LiveWiring, type LiveHost } from './live/live-wiring.js';
import type { QueryHost } from './position-from-point.js';
import type { Source, StageHost } from './stage-host.js';
import type { ScenePoint } from './camera/values.js';
import type { Tour, TourHost } from './views/tour.js';
import { statsOf, type ReadCounts, type SceneStats } from './stats.js';

/**
 * All that goes on behind the element's attributes and markup: scene, camera, size, sight and input, and who of them
 * tells whom. Fires the element's events. It is the host of all controllers: each of them says in an interface of its own what it asks of it.
 */
export class Stage
  extends ElementCore
  implements
    ViewHost,
    SceneHost,
    SourceHost,
    DetailHost,
    RevealHost,
    HotspotHost,
    PlaybackHost,
    InputHost,
    BehaviourHost,
    QueryHost,
    TourHost,
    LiveHost
{
  readonly camera: CameraController;
  readonly scene: SceneController;
  readonly detail: DetailController;
  readonly playback: PlaybackController;
  readonly reveal: RevealController;
  readonly behaviours: Behaviours;
  /** Labels of the page, where there are some. */
  hotspots: HotspotController | undefined;
  /** All that is drawn. */
  readonly world = new World();
  /** What is drawn of the element's own scene. */
  own: Member | undefined;
  /** Fulfils when what shows the element's children is there; undefined where it has none. */
  composing: Promise<void> | undefined;
  /** Share of the loading of its own scene that is done, 0..1; null while it is not known. */
  ownProgress: number | null = null;
  readonly size: SizeController;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  drawnFrom: Camera | undefined;
  readonly #visibility: VisibilityController;
  readonly view: ViewController;
  readonly live: LiveWiring;
  readonly #source: SourceController;
  #input: InputController | undefined;
  #listening: Promise<void> | undefined;
  #tour: Promise<Tour> | undefined;
  #counts: ReadCounts | undefined;
  #children: MutationObserver | undefined;
  #labelling: Promise<void> | undefined;
  /** Bytes that have arrived, and how many there are. */
  #bytes: [loaded: number, total: number | undefined] = [0, undefined];

  constructor(element: ReactiveControllerHost & HTMLElement, host: StageHost) {
    super(element, host);
    this.camera = new CameraController(host.attributes.camera, () => this.requestFrame());
    this.#visibility = new VisibilityController(element, () => this.#onVisibility());
    this.size = new SizeController(
      element,
      () => host.canvas,
      () => this.#onSize(),
    );
    this.playback = new PlaybackController(this);
    this.view = new ViewController(this);
    this.live = new LiveWiring(this);
    this.scene = new SceneController(element, this);
    this.#source = new SourceController(this);
    this.detail = new DetailController(this);
    this.reveal = new RevealController(element, this);
    this.behaviours = new Behaviours(element, this);
    new PrintController(element, () => this.drawNow());
    const onPageVisibility = (): void => this.suspend();
    element.addController({
      hostConnected: () => {
        document.addEventListener('visibilitychange', onPageVisibility);
        this.#children ??= new MutationObserver(() => this.#lookAtChildren());
        this.#children.observe(element, { childList: true, subtree: true, attributeFilter: ['slot', 'data-orbit'] });
        this.#lookAtChildren();
        // Put back after a while, an eager element loads again though nothing has come into sight.
        this.#source.request();
      },
      hostUpdated: () => this.updated(),
      hostDisconnected: () => {
        document.removeEventListener('visibilitychange', onPageVisibility);
        this.#children?.disconnect();
      },
    });
  }

  /** What flies from view to view: fetched by pages that have views, or ask for a flight. */
  tour(): Promise<Tour> {
    return (this.#tour ??= loadModule('the code for views', () => import('./views/tour.js')).then(
      ({ Tour }) => new Tour(this.element, this),
    ));
  }

  /** Draws a frame now and returns its canvas, to be read within the same task; null where there is nothing to draw. */
  drawNow(...picture: Parameters<ViewController['drawNow']>): HTMLCanvasElement | null {
    return this.scene.isPreview ? null : this.view.drawNow(...picture);
  }

  /** Frames the scene anew, as if it had just been loaded; one that a generator writes is measured first. */
  async updateFraming(): Promise<void> {
    const { scene } = this.scene;
    const bounds = await this.readBounds();
    if (bounds && this.scene.scene === scene) this.camera.frame(bounds);
  }

  /** What is known of the scene on show; null where there is none. */
  get stats(): SceneStats | null {
    const { shown } = this;
    if (shown.length === 0) return null;
    return statsOf(shown, {
      quality: this.attributes.quality,
      dynamicQuality: this.view.dynamicQuality,
      counts: this.#counts,
      isPreview: this.scene.isPreview,
      frameBytes: this.view.painter?.byteLength ?? 0,
      pixels: this.levels.detail,
    });
  }

  /** Asks the GPU for the counts of the picture on show. */
  async updateStats(): Promise<SceneStats | null> {
    const { painter } = this.view;
    const camera = this.drawnFrom;
    if (painter === null || camera === undefined) return this.stats;
    try {
      const counts = await painter.readCounts(camera);
      if (this.view.painter === painter) this.#counts = counts;
    } catch (error) {
      // What was asked for is gone; what there is now is known without it.
      if (!(await isGone(painter))) throw error;
    }
    return this.stats;
  }

  /** The scene to show. Called after every update; only changes act. */
  setSource(source: Source): void {
    this.#source.set(source);
    this.live.post.want(this.#source.postprocess);
    if (!this.isLeavingFor(source)) this.playback.keepScene();
  }

  /** Asks for the scene once more, whatever has become of it. */
  reload(): void {
    this.scene.want(null, false);
    this.#source.renew();
    this.element.requestUpdate();
  }

  /** Whether a source asks for another scene than the one that is shown or loaded. */
  isLeavingFor(source: Source): boolean {
    return this.#source.isOther(source);
  }

  /** Puts the clock of a scene to a time: the one on show, or the next if `source` asks for another. */
  seek(seconds: number, source: Source): void {
    if (this.isLeavingFor(source)) this.playback.startNextAt(seconds);
    else this.playback.currentTime = seconds;
  }

  /** Somebody wants the time to run: the poster gives way, and a scene out of sight is loaded. */
  prepareToPlay(): void {
    this.#source.needNow(true);
    if (!this.reveal.mayReveal) this.reveal.dismiss();
    this.element.requestUpdate();
  }

  /** Asks for a frame: a changed attribute may concern the picture, for example its pixel ratio. */
  requestFrame(): void {
    this.view.requestFrame();
  }

  /** The document that the element comes from has no window any more. */
  leaveWindowless(): void {
    this.view.renewCanvas();
  }

  /** Children bring what they need: few pages have any. */
  #lookAtChildren(): void {
    const has = (selector: string): boolean => this.element.querySelector(`:scope>:is(${selector})`) !== null;
    if (has('splat-scene,splat-mesh')) this.compose();
    if (has('[slot^=hotspot-]')) this.#label();
    if (this.#tour !== undefined || has('[data-orbit]')) this.#showViews();
  }

  /** Lets more be shown than the splats of one scene. */
  compose(): void {
    this.composing ??= loadModule('the code that shows several scenes', () => import('./composition/compose.js')).then(
      ({ compose }) => compose(this),
      (error: Error) => {
        this.composing = undefined;
        this.warn(error.message);
      },
    );
  }

  /** Listens to mouse, touch and keys: fetched by pages that let people move the camera. */
  #listen(): void {
    this.#listening ??= loadModule(
      'the code for mouse, touch and keys',
      () => import('./controllers/input-controller.js'),
    ).then(
      ({ InputController, PromptController }) => {
        this.#input = new InputController(this.element, this);
        this.behaviours.promptBy(new PromptController(this.element, this.behaviours));
      },
      (error: Error) => {
        this.#listening = undefined;
        this.warn(error.message);
      },
    );
  }

  /** Fulfils when the code is there that attributes and children ask for. */
  get codeKnown(): Promise<unknown> {
    return Promise.all([this.composing, this.#labelling, this.#listening]);
  }

  #showViews(): void {
    this.tour().then(
      () => this.element.requestUpdate(),
      (error: Error) => this.warn(error.message),
    );
  }

  #label(): void {
    this.#labelling ??= loadModule('the code of labels', () => import('./controllers/hotspot-controller.js')).then(
      ({ HotspotController }) => {
        this.hotspots = new HotspotController(this.element, this);
        if (this.drawnFrom) this.hotspots.frameDrawn(this.drawnFrom);
      },
      (error: Error) => {
        this.#labelling = undefined;
        this.warn(error.message);
      },
    );
  }

  // What the controllers ask.

  get state(): SceneState {
    return this.scene.state;
  }

  /** Why nothing is shown. */
  get error(): ElementError | null {
    return this.scene.error;
  }

  /** Fulfils, and never rejects, once nothing is left to wait for. */
  get settled(): Promise<void> {
    return this.scene.settled;
  }

  /** Share of the loading that is done, 0..1; null while it is not known. */
  get progress(): number | null {
    return this.ownProgress;
  }

  /** The sources that are drawn. */
  get shown(): readonly LoadedGaussians[] {
    return this.own ? [this.own.scene] : [];
  }

  /** How much detail is drawn, at rest too. */
  get levels(): DetailLevers {
    return this.own?.scene.detail ?? {};
  }

  /** What the page may set of the models on show. */
  get inputs(): readonly GeneratorInput[] {
    return [...(this.own?.scene.live?.inputs ?? []), ...(this.view.painter?.filter?.inputs ?? [])];
  }

  /** Where all of it is, in the frame of the element's own scene; null while nothing is shown. */
  get bounds(): SceneBounds | null {
    return this.own?.scene.bounds ?? null;
  }

  /** The same, measured anew where a generator may have moved it. */
  async readBounds(): Promise<SceneBounds | null> {
    return (await this.own?.scene.live?.readBounds?.()) ?? this.bounds;
  }

  prepareFrame(): string {
    void this.own?.placement;
    const { layout, changes, placements } = this.world;
    return `${layout} ${changes} ${placements.map(({ scene }) => scene.version).join()}`;
  }

  /** Looks into the last frame. Rejects if it is gone. */
  async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    return (await this.view.painter?.probe(points)) ?? [];
  }

  get isVisible(): boolean {
    return this.#visibility.isVisible;
  }

  /** Fingers have moved the camera, and have no Home key. */
  get offersReset(): boolean {
    return this.input.enabled && this.isOnShow && this.#input?.isTouch === true && this.camera.isTouched;
  }

  /** Somebody would see the scene. */
  get isInSight(): boolean {
    return this.isVisible && this.reveal.mayReveal;
  }

  /** The scene is on show, in sight, and no poster covers it. */
  get isOnShow(): boolean {
    return !this.reveal.isCovered && this.isVisible;
  }

  get hasPicture(): boolean {
    return this.scene.state === 'ready' || this.scene.isPreview;
  }

  get player(): BehaviourHost['player'] {
    return this.autoplays ? this.playback : undefined;
  }

  get wantsPreviews(): boolean {
    return this.isVisible;
  }

  get liveRequest(): SceneHost['liveRequest'] {
    return {
      element: this.element,
      runtimeLocation: this.services.runtimeLocation,
      loader: this.services.sceneLoader,
      state: () => this.live.state,
      ownsControls: () => !this.live.post.isWanted,
      camera: (bounds) => {
        if (bounds) this.camera.frame(bounds);
        return this.firstView;
      },
      listeners: this.live.listeners,
    };
  }

  /** The camera before the picture has a size. */
  get firstView(): Camera {
    return this.camera.view(...FIRST_SIZE);
  }

  // What they tell.

  beforeFrame(now: number): void {
    this.behaviours.advance(now);
  }

  advanceScene(camera: Camera, now: number): void {
    const { scene, live } = this;
    // The last picture of a scene whose place another will take stays as it is.
    if (scene.scene && !scene.isOutgoing) live.advance(scene.scene, camera, now);
  }

  afterFrame(camera: Camera): void {
    this.drawnFrom = camera;
    this.hotspots?.frameDrawn(camera);
  }

  cameraChanged(source: CameraChangeSource): void {
    this.behaviours.announcer.cameraMoved();
    this.dispatch(new CustomEvent('camera-change', { detail: { source } }));
  }

  /** Other splats are drawn than before. */
  splatsChanged(): void {
    this.#counts = undefined;
    this.view.requestFrame();
    this.element.requestUpdate();
  }

  notePace(isWhole: boolean): void {
    this.detail.notePace(isWhole);
  }

  drawingFailed(error: unknown): void {
    this.scene.fail(error);
  }

  playbackEvent(type: PlaybackEvent): void {
    this.dispatch(new Event(type));
    // Custom states tell of them, too.
    if (type === 'play' || type === 'pause') this.element.requestUpdate();
  }

  show(scene: LoadedGaussians, entrance: Entrance): Promise<void> {
    this.#counts = undefined;
    const { camera, view } = this;
    if (entrance === 'new') camera.frame(scene.bounds);
    if (entrance === 'whole') camera.refine(scene.bounds);
    this.playback.setDuration(scene.live?.duration ?? NaN);
    if (scene.hasMeshes) this.compose();
    this.own = this.enter(scene);
    const drawn = view.show(scene);
    this.live.post.attach(view.painter);
    this.live.tellInputs(this.inputs);
    return drawn;
  }

  /** Puts what is loaded into the world. */
  enter(scene: LoadedGaussians): Member {
    scene.onChange = () => this.requestFrame();
    for (const warning of scene.warnings) this.warn(`<gaussian-splat>: ${warning}`);
    return new Member(this.world, scene);
  }

  hide(clear: boolean): void {
    this.own?.remove();
    this.own = undefined;
    this.stopDrawing(clear);
  }

  /** Nothing is shown any more; the last picture stays unless it is to be cleared. */
  stopDrawing(clear: boolean): void {
    this.live.post.attach(null);
    this.playback.suspend();
    if (!clear) return this.view.pause();
    this.playback.empty();
    this.drawnFrom = undefined;
    this.hotspots?.forget();
    this.view.clear();
  }

  loadStarted(): void {
    this.dispatch(new Event('loadstart'));
  }

  progressed(loaded: number, total: number | undefined, share = total ? loaded / total : undefined): void {
    this.#bytes = [loaded, total];
    this.ownProgress = share === undefined ? null : Math.min(1, share);
    this.element.requestUpdate();
    const lengthComputable = total !== undefined;
    this.dispatch(new ProgressEvent('progress', { lengthComputable, loaded, total: total ?? 0 }));
  }

  previewShown({ gaussians }: LoadedGaussians): void {
    this.element.requestUpdate();
    this.dispatch(new CustomEvent('preview', { detail: { splats: gaussians.count } }));
    this.progressed(...this.#bytes);
  }

  loaded(url: string): void {
    for (const type of ['loadeddata', 'canplay'] as const) this.dispatch(new Event(type));
    this.dispatch(new CustomEvent('load', { detail: { url } }));
  }

  emptied(): void {
    this.#source.needNow(false);
    this.ownProgress = null;
    this.playback.empty();
    this.playback.stopWaits();
    this.dispatch(new Event('emptied'));
  }

  failed(error: ElementError): void {
    this.ownProgress = null;
    this.dispatch(new CustomEvent('error', { detail: error }));
  }

  contextChanged(type: 'contextlost' | 'contextrestored'): void {
    this.dispatch(new Event(type));
  }

  /** A pause of the picture is not time that passes. */
  suspend(): void {
    this.playback.suspend();
  }

  /** Starts what plays by itself, where it may. */
  autoplay(): void {
    const { playback } = this;
    const mayPlay = playback.canPlay && playback.paused && !prefersReducedMotion();
    if (this.autoplays && mayPlay && !this.behaviours.motion.isHeld) playback.play();
  }

  posterDismissed(): void {
    this.dispatch(new Event('poster-dismissed'));
    this.autoplay();
  }

  act(action: CameraAction): boolean {
    return this.behaviours.act(action);
  }

  /** The visible surface under a point of the page: see the element's method of this name. */
  async positionFromPoint(clientX: number, clientY: number): Promise<ScenePoint | null> {
    const { positionFromPoint } = await loadModule(
      'the code that finds points of the scene',
      () => import('./position-from-point.js'),
    );
    return positionFromPoint(this, clientX, clientY);
  }

  /** Beside the scene is where somebody has lost it. */
  pick(clientX: number, clientY: number): void {
    this.positionFromPoint(clientX, clientY).then(
      (point) => {
        if (point === null) this.act({ type: 'reset' });
        else if (this.input.pan) this.behaviours.aimAt([point.x, point.y, point.z]);
      },
      (error: Error) => this.warn(error.message),
    );
  }

  /** The space bar, for all that moves. A player's controls around the element have keys of their own. */
  toggleMotion(): boolean {
    if (this.behaviours.motion.toggle()) return true;
    if (!this.playback.canPlay || this.element.slot === 'media') return false;
    if (this.playback.paused) this.playback.play();
    else this.playback.pause();
    return true;
  }

  /** Called after each update of the element. */
  updated(): void {
    if (this.views && this.#tour === undefined) this.#showViews();
    if (this.input.enabled) this.#listen();
    this.reveal.settle();
    this.detail.update(this.scene.state === 'ready' ? this.scene.scene : null);
  }

  #onVisibility(): void {
    this.#source.request();
    if (!this.#visibility.isVisible) this.suspend();
    this.dispatch(new CustomEvent('model-visibility', { detail: { visible: this.#visibility.isVisible } }));
    this.element.requestUpdate();
    this.view.requestFrame();
  }

  #onSize(): void {
    // Without a size, in a closed tab for one, there is no shape to follow.
    if (!this.size.isEmpty) this.camera.setAspect(this.size.aspect);
    this.view.requestFrame();
  }
}

/** Width and height, in pixels, that a generator hears of before the picture has a size: those of an element without style. */
const FIRST_SIZE = [300, 150] as const;
