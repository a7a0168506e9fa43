import type { Camera } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer';
import type { ReactiveControllerHost } from 'lit';
import { Behaviours, type BehaviourHost } from './behaviours.js';
import type { CameraAction } from './camera/gestures.js';
import { CameraController } from './controllers/camera-controller.js';
import { DetailController, type DetailHost } from './controllers/detail-controller.js';
import { HotspotController, type HotspotHost } from './controllers/hotspot-controller.js';
import { InputController, type InputHost } from './controllers/input-controller.js';
import { prefersReducedMotion } from './controllers/mover.js';
import { PlaybackController, type PlaybackEvent, type PlaybackHost } from './controllers/playback-controller.js';
import { PrintController } from './controllers/print-controller.js';
import { RevealController, type RevealHost } from './controllers/reveal-controller.js';
import { SceneController, type Entrance, type SceneHost } from './controllers/scene-controller.js';
import { SizeController } from './controllers/size-controller.js';
import { SourceController, type SourceHost } from './controllers/source-controller.js';
import { ViewController, type ViewHost } from './controllers/view-controller.js';
import { VisibilityController } from './controllers/visibility-controller.js';
import { ElementCore } from './element-core.js';
import type { ElementError } from './errors.js';
import type { CameraChangeSource } from './events.js';
import { isGone } from './gpu/device-failures.js';
import type { DrawnScene } from './gpu/open-scene.js';
import { LiveWiring, type LiveHost } from './live/live-wiring.js';
import { SceneQueries, type QueryHost } from './scene-queries.js';
import type { Source, StageHost } from './stage-host.js';
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
    LiveHost
{
  readonly camera: CameraController;
  readonly scene: SceneController;
  readonly detail: DetailController;
  readonly playback: PlaybackController;
  readonly reveal: RevealController;
  readonly behaviours: Behaviours;
  readonly hotspots: HotspotController;
  readonly queries: SceneQueries;
  /** Share of the loading that is done, 0..1; null while it is not known. */
  progress: number | null = null;
  readonly size: SizeController;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  drawnFrom: Camera | undefined;
  readonly #visibility: VisibilityController;
  readonly #view: ViewController;
  readonly #live: LiveWiring;
  readonly #source: SourceController;
  #counts: ReadCounts | undefined;
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
    this.#view = new ViewController(this);
    this.#live = new LiveWiring(this);
    this.scene = new SceneController(element, this);
    this.#source = new SourceController(this);
    this.detail = new DetailController(this);
    this.reveal = new RevealController(element, this);
    this.behaviours = new Behaviours(element, this);
    this.hotspots = new HotspotController(element, this);
    new PrintController(element, () => this.drawNow());
    this.queries = new SceneQueries(this);
    new InputController(element, this);
    const onPageVisibility = (): void => this.playback.suspend();
    element.addController({
      hostConnected: () => {
        document.addEventListener('visibilitychange', onPageVisibility);
        // Put back after a while, an eager element loads again though nothing has come into sight.
        this.#source.request();
      },
      hostUpdated: () => this.#onUpdate(),
      hostDisconnected: () => document.removeEventListener('visibilitychange', onPageVisibility),
    });
  }

  /** Draws a frame now and returns its canvas, to be read within the same task; null where there is nothing to draw. */
  drawNow(): HTMLCanvasElement | null {
    return this.scene.isPreview ? null : this.#view.drawNow();
  }

  /** Frames the scene anew, as if it had just been loaded; one that a generator writes is measured first. */
  async updateFraming(): Promise<void> {
    const { scene } = this.scene;
    if (scene === null) return;
    const bounds = (await scene.live?.readBounds?.()) ?? scene.bounds;
    if (this.scene.scene === scene) this.camera.frame(bounds);
  }

  /** What is known of the scene on show; null where there is none. */
  get stats(): SceneStats | null {
    const { scene } = this.scene;
    if (scene === null) return null;
    const { quality } = this.attributes;
    return statsOf(scene, {
      quality,
      pace: this.#view.pace.report,
      counts: this.#counts,
      isPreview: this.scene.isPreview,
    });
  }

  /** Asks the GPU for the counts of the picture on show. */
  async updateStats(): Promise<SceneStats | null> {
    const { scene } = this.scene;
    const camera = this.drawnFrom;
    if (scene === null || camera === undefined) return this.stats;
    try {
      const counts = await scene.readCounts(camera);
      if (this.scene.scene === scene) this.#counts = counts;
    } catch (error) {
      // What was asked for is gone; what there is now is known without it.
      if (!(await isGone(scene))) throw error;
    }
    return this.stats;
  }

  /** The scene to show. Called after every update; only changes act. */
  setSource(source: Source): void {
    this.#source.set(source);
    this.#live.post.want(this.#source.postprocess);
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
    this.#view.requestFrame();
  }

  /** The document that the element comes from has no window any more. */
  leaveWindowless(): void {
    this.#view.renewCanvas();
  }

  // What the controllers ask.

  get isVisible(): boolean {
    return this.#visibility.isVisible;
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

  get wantsPreviews(): boolean {
    return this.isVisible;
  }

  get liveRequest(): SceneHost['liveRequest'] {
    return {
      element: this.element,
      runtimeLocation: this.services.runtimeLocation,
      startWorker: this.services.sceneLoader.spawn,
      state: () => this.#live.state,
      ownsControls: () => !this.#live.post.isWanted,
      camera: (bounds) => {
        if (bounds) this.camera.frame(bounds);
        return this.camera.view(...FIRST_SIZE);
      },
      listeners: this.#live.listeners,
    };
  }

  async probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]> {
    return (await this.scene.scene?.probe(points)) ?? [];
  }

  // What they tell.

  beforeFrame(now: number): void {
    this.behaviours.advance(now);
  }

  advanceScene(scene: DrawnScene, camera: Camera, now: number): void {
    // The last picture of a scene whose place another will take stays as it is.
    if (!this.scene.isOutgoing) this.#live.advance(scene, camera, now);
  }

  afterFrame(camera: Camera): void {
    this.drawnFrom = camera;
    this.hotspots.frameDrawn(camera);
  }

  cameraChanged(source: CameraChangeSource): void {
    this.behaviours.announcer.cameraMoved();
    this.dispatch(new CustomEvent('camera-change', { detail: { source } }));
  }

  /** Other splats are drawn of the scene on show. */
  splatsChanged(): void {
    this.#counts = undefined;
    this.#view.requestFrame();
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

  show(scene: DrawnScene, entrance: Entrance): Promise<void> {
    this.#counts = undefined;
    if (entrance === 'new') this.camera.frame(scene.bounds);
    if (entrance === 'whole') this.camera.refine(scene.bounds);
    this.playback.setDuration(scene.live?.duration ?? NaN);
    this.#live.post.attach(scene);
    return this.#view.show(scene);
  }

  hide(clear: boolean): void {
    this.#live.post.attach(null);
    this.playback.suspend();
    if (!clear) return this.#view.pause();
    this.playback.empty();
    this.drawnFrom = undefined;
    this.hotspots.forget();
    this.#view.clear();
  }

  loadStarted(): void {
    this.dispatch(new Event('loadstart'));
  }

  progressed(loaded: number, total: number | undefined, share = total ? loaded / total : undefined): void {
    this.#bytes = [loaded, total];
    this.progress = share === undefined ? null : Math.min(1, share);
    this.element.requestUpdate();
    const lengthComputable = total !== undefined;
    this.dispatch(new ProgressEvent('progress', { lengthComputable, loaded, total: total ?? 0 }));
  }

  previewShown({ gaussians }: DrawnScene): void {
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
    this.progress = null;
    this.playback.empty();
    this.playback.stopWaits();
    this.dispatch(new Event('emptied'));
  }

  failed(error: ElementError): void {
    this.progress = null;
    this.dispatch(new CustomEvent('error', { detail: error }));
  }

  contextChanged(type: 'contextlost' | 'contextrestored'): void {
    this.dispatch(new Event(type));
  }

  posterDismissed(): void {
    this.dispatch(new Event('poster-dismissed'));
    const mayPlay = this.playback.canPlay && this.playback.paused && !prefersReducedMotion();
    if (this.autoplays && mayPlay && !this.behaviours.motion.isHeld) this.playback.play();
  }

  act(action: CameraAction): void {
    this.behaviours.act(action);
  }

  pick(clientX: number, clientY: number): void {
    void this.queries.positionFromPoint(clientX, clientY).then((point) => {
      if (point !== null && this.retargets) this.behaviours.aimAt([point.x, point.y, point.z]);
    });
  }

  /** The space bar, for all that moves. A player's controls around the element have keys of their own. */
  toggleMotion(): boolean {
    if (this.behaviours.motion.toggle()) return true;
    if (!this.playback.canPlay || this.element.slot === 'media') return false;
    if (this.playback.paused) this.playback.play();
    else this.playback.pause();
    return true;
  }

  #onUpdate(): void {
    this.reveal.settle();
    this.detail.update(this.scene.state === 'ready' ? this.scene.scene : null);
  }

  #onVisibility(): void {
    this.#source.request();
    if (!this.#visibility.isVisible) this.playback.suspend();
    this.dispatch(new CustomEvent('model-visibility', { detail: { visible: this.#visibility.isVisible } }));
    this.element.requestUpdate();
    this.#view.requestFrame();
  }

  #onSize(): void {
    // Without a size, in a closed tab for one, there is no shape to follow.
    if (!this.size.isEmpty) this.camera.setAspect(this.size.aspect);
    this.#view.requestFrame();
  }
}

/** Width and height, in pixels, that a generator hears of before the picture has a size: those of an element without style. */
const FIRST_SIZE = [300, 150] as const;
