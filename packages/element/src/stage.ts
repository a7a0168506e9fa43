import type { Camera } from '@gaussian-splat/core';
import type { ReactiveControllerHost } from 'lit';
import { Behaviours } from './behaviours.js';
import { CameraController } from './controllers/camera-controller.js';
import { DetailController } from './controllers/detail-controller.js';
import { EconomyController } from './controllers/economy-controller.js';
import { HotspotController } from './controllers/hotspot-controller.js';
import { prefersReducedMotion } from './controllers/mover.js';
import { PlaybackController } from './controllers/playback-controller.js';
import { PrintController } from './controllers/print-controller.js';
import { InputController } from './controllers/input-controller.js';
import { RevealController } from './controllers/reveal-controller.js';
import { SceneController } from './controllers/scene-controller.js';
import { SourceController } from './controllers/source-controller.js';
import { SizeController } from './controllers/size-controller.js';
import { ViewController } from './controllers/view-controller.js';
import { VisibilityController } from './controllers/visibility-controller.js';
import { isGone } from './gpu/device-failures.js';
import { FrameScheduler } from './gpu/frame-scheduler.js';
import type { GaussianSplatEventMap } from './events.js';
import { defaultMemoryBudget } from './gpu/memory-budget.js';
import { LiveWiring } from './live/live-wiring.js';
import { SceneQueries } from './scene-queries.js';
import { statsOf, type ReadCounts, type SceneStats } from './stats.js';
import type { Source, StageOptions } from './stage-options.js';
import { windowOf } from './window-of.js';

/**
 * All that goes on behind the element's attributes and markup: scene, camera, size, sight and input, and who of them
 * tells whom. Fires the element's events.
 */
export class Stage {
  readonly camera: CameraController;
  readonly scene: SceneController;
  readonly economy: EconomyController;
  readonly detail: DetailController;
  readonly playback: PlaybackController;
  readonly reveal: RevealController;
  readonly behaviours: Behaviours;
  readonly hotspots: HotspotController;
  readonly queries: SceneQueries;
  /** Share of the loading that is done, 0..1; null while it is not known. */
  progress: number | null = null;
  readonly #host: ReactiveControllerHost & HTMLElement;
  readonly #options: StageOptions;
  readonly #visibility: VisibilityController;
  readonly #size: SizeController;
  readonly #view: ViewController;
  readonly #live: LiveWiring;
  readonly #source: SourceController;
  #drawnFrom: Camera | undefined;
  #counts: ReadCounts | undefined;
  /** Bytes that have arrived, and how many there are. */
  #bytes: [loaded: number, total: number | undefined] = [0, undefined];

  constructor(host: ReactiveControllerHost & HTMLElement, options: StageOptions) {
    this.#host = host;
    this.#options = options;
    this.camera = new CameraController(options.attributes().camera, () => this.#view.requestFrame());
    this.#visibility = new VisibilityController(host, () => this.#onVisibility());
    this.#size = new SizeController(host, options.canvas, () => this.#onSize());
    this.playback = new PlaybackController({
      loops: options.loops,
      startTime: options.startTime,
      requestFrame: () => this.#view.requestFrame(),
      dispatch: (type) => {
        this.#dispatch(new Event(type));
        // Custom states tell of them, too.
        if (type === 'play' || type === 'pause') host.requestUpdate();
      },
    });
    this.#view = this.#createView();
    this.#live = new LiveWiring({
      ...options,
      playback: this.playback,
      requestFrame: () => this.#view.requestFrame(),
      dispatch: (event) => this.#dispatch(event),
    });
    this.scene = this.#createScene();
    this.#source = new SourceController({
      ...options,
      isInSight: () => this.#visibility.isVisible && this.reveal.mayReveal,
      isConnected: () => host.isConnected,
      want: (request, mayStart) => this.scene.want(request, mayStart),
      isOther: (request) => this.scene.isOther(request),
    });
    this.economy = new EconomyController({
      economy: options.economy,
      memoryBudget: () => this.#memoryBudget(),
      onChange: () => this.#onOtherSplats(),
      warn: options.warn,
    });
    this.detail = new DetailController({
      detail: () => options.attributes().detail,
      loader: () => options.services().sceneLoader,
      memoryBudget: () => this.#memoryBudget(),
      onChange: () => this.#onOtherSplats(),
      warn: options.warn,
    });
    this.reveal = new RevealController(host, {
      mode: () => options.attributes().reveal,
      isReady: () => this.scene.state === 'ready' || this.scene.isPreview,
      onDismissed: () => this.#onRevealed(),
    });
    this.behaviours = this.#createBehaviours();
    this.hotspots = new HotspotController(host, {
      layer: options.hotspotLayer,
      viewerFrame: () => this.camera.viewerFrame,
      scale: () => this.camera.bounds.radius,
      probe: async (points) => (await this.scene.scene?.probe(points)) ?? [],
      warn: options.warn,
    });
    new PrintController(host, () => this.drawNow());
    this.queries = new SceneQueries({
      camera: this.camera,
      scene: () => this.scene.scene,
      drawnFrom: () => this.#drawnFrom,
      element: host,
    });
    new InputController(host, options.surface, options.input, {
      act: (action) => this.behaviours.act(action),
      pick: (x, y) => void this.#retarget(x, y),
      toggleMotion: () => this.#toggleMotion(),
    });
    const onPageVisibility = (): void => this.playback.suspend();
    host.addController({
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
    const { quality } = this.#options.attributes();
    return statsOf(scene, {
      quality,
      pace: this.#view.pace.report,
      counts: this.#counts,
      economy: this.economy.report,
      isPreview: this.scene.isPreview,
    });
  }

  /** Asks the GPU for the counts of the picture on show. */
  async updateStats(): Promise<SceneStats | null> {
    const { scene } = this.scene;
    const camera = this.#drawnFrom;
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
    this.#host.requestUpdate();
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
    this.#host.requestUpdate();
  }

  /** Asks for a frame: a changed attribute may concern the picture, for example its pixel ratio. */
  requestFrame(): void {
    this.#view.requestFrame();
  }

  /** The document that the element comes from has no window any more. */
  leaveWindowless(): void {
    this.#view.renewCanvas();
  }

  #createView(): ViewController {
    const { attributes, canvas } = this.#options;
    return new ViewController({
      scheduler: () => FrameScheduler.of(windowOf(this.#host)),
      camera: this.camera,
      size: this.#size,
      canvasOf: canvas,
      isVisible: () => this.#visibility.isVisible,
      maxPixelRatio: () => attributes().maxPixelRatio,
      frameBudget: () => attributes().frameBudget,
      rendering: () => ({ quality: attributes().quality, shDegree: attributes().maxShDegree }),
      decayMs: () => (prefersReducedMotion() ? 0 : attributes().interpolationDecay),
      beforeFrame: (now) => this.behaviours.advance(now),
      afterFrame: (camera) => {
        this.#drawnFrom = camera;
        this.hotspots.frameDrawn(camera);
      },
      onFrame: (scene, camera, now) => {
        // The last picture of a scene whose place another will take stays as it is.
        if (!this.scene.isOutgoing) this.#live.advance(scene, camera, now);
      },
      onCameraChange: (source) => {
        this.behaviours.announcer.cameraMoved();
        this.#dispatch(new CustomEvent('camera-change', { detail: { source } }));
      },
      onPace: (isWhole) => this.detail.notePace(isWhole),
      onError: (error) => this.scene.fail(error),
    });
  }

  #createScene(): SceneController {
    const { services } = this.#options;
    return new SceneController(this.#host, {
      device: () => services().sharedDevice,
      loader: () => services().sceneLoader,
      releaseDelayMs: () => services().releaseDelay,
      show: (scene, entrance) => {
        this.#counts = undefined;
        if (entrance === 'new') this.camera.frame(scene.bounds);
        if (entrance === 'whole') this.camera.refine(scene.bounds);
        this.playback.setDuration(scene.live?.duration ?? NaN);
        this.#live.post.attach(scene);
        return this.#view.show(scene);
      },
      hide: (clear) => {
        this.#live.post.attach(null);
        this.playback.suspend();
        if (!clear) return this.#view.pause();
        this.playback.empty();
        this.#drawnFrom = undefined;
        this.hotspots.forget();
        this.#view.clear();
      },
      frameUrl: (url) => this.#options.services().urlModifier?.(url) ?? url,
      loops: this.#options.loops,
      wantsPreviews: () => this.#visibility.isVisible,
      onPreview: ({ gaussians }) => this.#onPreview(gaussians.count),
      memoryBudget: () => this.#memoryBudget(),
      live: () => ({
        element: this.#host,
        runtimeLocation: services().runtimeLocation,
        state: () => this.#live.state,
        ownsControls: () => !this.#live.post.isWanted,
        camera: (bounds) => {
          if (bounds) this.camera.frame(bounds);
          return this.camera.view(...FIRST_SIZE);
        },
        listeners: this.#live.listeners,
      }),
      onProgress: (...progress) => this.#onProgress(...progress),
      onStart: () => this.#dispatch(new Event('loadstart')),
      onLoad: (url) => this.#onLoad(url),
      onEmptied: () => {
        this.#source.needNow(false);
        this.progress = null;
        this.playback.empty();
        this.playback.stopWaits();
        this.#dispatch(new Event('emptied'));
      },
      onError: (error) => {
        this.progress = null;
        this.#dispatch(new CustomEvent('error', { detail: error }));
      },
      onContext: (type) => this.#dispatch(new Event(type)),
    });
  }

  #memoryBudget(): number | undefined {
    return this.#options.services().memoryBudget ?? defaultMemoryBudget();
  }

  #createBehaviours(): Behaviours {
    const { attributes, autoRotates, autoplays, strings, surface, input } = this.#options;
    return new Behaviours(this.#host, this.camera, {
      attributes,
      hasControls: () => input().enabled,
      autoRotates,
      autoplays,
      playback: this.playback,
      strings,
      isOnShow: () => !this.reveal.isCovered && this.#visibility.isVisible,
      surface,
      requestFrame: () => this.#view.requestFrame(),
    });
  }

  #onLoad(url: string): void {
    for (const type of ['loadeddata', 'canplay'] as const) this.#dispatch(new Event(type));
    this.#dispatch(new CustomEvent('load', { detail: { url } }));
  }

  #onUpdate(): void {
    this.reveal.settle();
    const whole = this.scene.state === 'ready' ? this.scene.scene : null;
    this.economy.update(whole);
    this.detail.update(whole);
  }

  #onOtherSplats(): void {
    this.#counts = undefined;
    this.#view.requestFrame();
    this.#host.requestUpdate();
  }

  #onPreview(splats: number): void {
    this.#host.requestUpdate();
    this.#dispatch(new CustomEvent('preview', { detail: { splats } }));
    this.#onProgress(...this.#bytes);
  }

  #onRevealed(): void {
    this.#dispatch(new Event('poster-dismissed'));
    const mayPlay = this.playback.canPlay && this.playback.paused && !prefersReducedMotion();
    if (this.#options.autoplays() && mayPlay && !this.behaviours.motion.isHeld) this.playback.play();
  }

  /** The space bar, for all that moves. A player's controls around the element have keys of their own. */
  #toggleMotion(): boolean {
    if (this.behaviours.motion.toggle()) return true;
    if (!this.playback.canPlay || this.#host.slot === 'media') return false;
    if (this.playback.paused) this.playback.play();
    else this.playback.pause();
    return true;
  }

  async #retarget(clientX: number, clientY: number): Promise<void> {
    const point = await this.queries.positionFromPoint(clientX, clientY);
    if (point !== null && this.#options.retargets()) this.behaviours.aimAt([point.x, point.y, point.z]);
  }

  #onVisibility(): void {
    this.#source.request();
    if (!this.#visibility.isVisible) this.playback.suspend();
    this.#dispatch(new CustomEvent('model-visibility', { detail: { visible: this.#visibility.isVisible } }));
    this.#host.requestUpdate();
    this.#view.requestFrame();
  }

  #onSize(): void {
    // Without a size, in a closed tab for one, there is no shape to follow.
    if (!this.#size.isEmpty) this.camera.setAspect(this.#size.aspect);
    this.#view.requestFrame();
  }

  #onProgress(loaded: number, total: number | undefined, share = total ? loaded / total : undefined): void {
    this.#bytes = [loaded, total];
    this.progress = share === undefined ? null : Math.min(1, share);
    this.#host.requestUpdate();
    const lengthComputable = total !== undefined;
    this.#dispatch(new ProgressEvent('progress', { lengthComputable, loaded, total: total ?? 0 }));
  }

  #dispatch(event: GaussianSplatEventMap[keyof GaussianSplatEventMap]): void {
    this.#host.dispatchEvent(event);
  }
}

/** Width and height, in pixels, that a generator hears of before the picture has a size: those of an element without style. */
const FIRST_SIZE = [300, 150] as const;
