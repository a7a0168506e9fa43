import type { Quality } from '@gaussian-splat/renderer';
import { isServer, LitElement, type PropertyDeclarations, type PropertyValues, type TemplateResult } from 'lit';
import { readAttributes, type Attributes, type Loading, type TouchAction } from './attributes.js';
import type { CameraOrbit, CameraTarget, FieldOfView } from './camera/values.js';
import type { ElementError } from './errors.js';
import type { GaussianSplatEventMap } from './events.js';
import { FrameScheduler } from './gpu/frame-scheduler.js';
import { SharedDevice } from './gpu/shared-device.js';
import { SceneLoader } from './loading/scene-loader.js';
import type { LiveState } from './live/live-model.js';
import { CONTROL_PREFIX, readControls, readNumbers, type ControlValues, type Numbers } from './live/values.js';
import { Stage } from './stage.js';
import { styles } from './styles.js';
import { DEFAULT_LABEL, template } from './template.js';

/** Size of the scene on show. */
export interface SceneStatistics {
  /** Splats on the GPU. */
  readonly splats: number;
  /** Splats of the file that were left out because a value was not usable. */
  readonly dropped: number;
  /** Bytes of GPU memory that the splats take. */
  readonly bytes: number;
}

/** Names of the custom states, for `gaussian-splat:state(ready)` in CSS. */
const STATES = ['loading', 'ready', 'error', 'unsupported'] as const;

/**
 * Shows a Gaussian splat scene.
 *
 * ```html
 * <gaussian-splat src="scene.ply" alt="A skull on a table" camera-controls></gaussian-splat>
 * ```
 *
 * @slot poster - Shown until the scene is.
 * @slot progress-bar - Shown while the scene loads.
 * @slot fallback - Shown where the browser has no WebGPU.
 * @slot error - Shown if the scene cannot be.
 * @csspart canvas - The picture.
 * @csspart poster - The image of the `poster` attribute.
 * @csspart progress-track - The progress bar's ground.
 * @csspart progress-bar - The progress bar.
 * @csspart fallback - The default text where there is no WebGPU.
 * @csspart error - The default text after an error.
 * @cssproperty --poster-fit - `object-fit` of the poster; default `cover`.
 * @cssproperty --poster-transition - How long the poster fades; default 0.3s.
 * @cssproperty --progress-bar-color - Colour of the progress bar.
 * @cssproperty --progress-track-color - Colour behind it.
 * @cssproperty --progress-bar-height - Its height; default 4px.
 * @cssproperty --message-background - Ground of the default texts.
 * @cssproperty --message-color - Their colour.
 * @cssproperty --message-font - Their font.
 * @cssstate loading - Bytes are on their way.
 * @cssstate ready - The scene is on show.
 * @cssstate error - It cannot be shown.
 * @cssstate unsupported - It cannot be shown because there is no WebGPU.
 * @fires load - The first frame is drawn.
 * @fires progress - Bytes have arrived.
 * @fires error - The scene cannot be shown; `detail` is the same object as the property `error`.
 * @fires camera-change - The camera has moved; `detail.source` says who moved it.
 * @fires generator-error - A run of the generator failed; the last good frame stays.
 * @fires generator-fallback - The generator runs on the CPU; `detail.reason` says why.
 * @fires play, playing, pause, timeupdate, seeking, seeked, ended, ratechange, durationchange, loadedmetadata - As of HTMLMediaElement.
 * @fires contextlost - The GPU device was lost; the element recovers by itself.
 * @fires contextrestored - The picture is back.
 */
// The interface below only gives inherited methods their types: nothing in it could be missing at run time.
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class GaussianSplatElement extends LitElement {
  /** The GPU device of all elements. A page with a device of its own may put `new SharedDevice(...)` here beforehand. */
  static sharedDevice = new SharedDevice();
  /** Loads the scenes of all elements. */
  static sceneLoader = new SceneLoader();
  /** Draws the frames of all elements. */
  static frameScheduler = new FrameScheduler();
  /** How long a removed element keeps its scene, in milliseconds: moving it within the page costs nothing. */
  static releaseDelay = 1_000;
  /**
   * Bytes of GPU memory that one scene may take; a larger one is refused with `out-of-memory/budget` before any of it is allocated. null, the
   * default: half of the memory that the browser says the device has (`navigator.deviceMemory`), no limit where it does not say.
   */
  static memoryBudget: number | null = null;
  /** Folder of the files of onnxruntime-web 1.30.0, which generators need; null for `onnxruntime/` beside the bundle. */
  static runtimeLocation: string | null = null;

  static override styles = styles;
  static override properties: PropertyDeclarations = {
    src: {},
    crossorigin: {},
    poster: {},
    alt: {},
    loading: {},
    cameraControls: { type: Boolean, attribute: 'camera-controls' },
    cameraOrbit: { attribute: 'camera-orbit' },
    cameraTarget: { attribute: 'camera-target' },
    fieldOfView: { attribute: 'field-of-view' },
    minCameraOrbit: { attribute: 'min-camera-orbit' },
    maxCameraOrbit: { attribute: 'max-camera-orbit' },
    minFieldOfView: { attribute: 'min-field-of-view' },
    maxFieldOfView: { attribute: 'max-field-of-view' },
    interpolationDecay: { attribute: 'interpolation-decay' },
    touchAction: { attribute: 'touch-action' },
    disableZoom: { type: Boolean, attribute: 'disable-zoom' },
    disablePan: { type: Boolean, attribute: 'disable-pan' },
    up: {},
    maxPixelRatio: { attribute: 'max-pixel-ratio' },
    quality: {},
    contract: {},
    chain: {},
    postprocess: {},
    time: {},
    pose: {},
    loop: { type: Boolean },
    controls: { attribute: false },
  };

  /** URL of the scene file. */
  declare src: string | null;
  /** As of `<img>`: `use-credentials` sends cookies to other origins. */
  declare crossorigin: 'anonymous' | 'use-credentials' | '' | null;
  /** URL of an image shown until the scene is. */
  declare poster: string | null;
  /** Text alternative. Absent: the host's `aria-label`, else "3D scene". Empty: the scene is decorative. */
  declare alt: string | null;
  /** `lazy`, the default, loads once the element is in sight; `eager` at once. */
  declare loading: Loading | null;
  /** Lets people orbit, pan and zoom with mouse, touch and keyboard. */
  declare cameraControls: boolean;
  /** `"theta phi radius"`; default `0deg 75deg auto`. Where the camera goes: see {@link getCameraOrbit}. */
  declare cameraOrbit: string | null;
  /** `"x y z"` in metres of viewer space (y up, right-handed); default `auto`, the middle of the scene. */
  declare cameraTarget: string | null;
  /** Vertical field of view, such as `45deg`; default `auto`. */
  declare fieldOfView: string | null;
  /** Least `camera-orbit`. */
  declare minCameraOrbit: string | null;
  /** Greatest `camera-orbit`. */
  declare maxCameraOrbit: string | null;
  /** Least `field-of-view`. */
  declare minFieldOfView: string | null;
  /** Greatest `field-of-view`. */
  declare maxFieldOfView: string | null;
  /** Time constant of the camera's motion in milliseconds; default 50. 0, or a wish for less motion, jumps. */
  declare interpolationDecay: number | string | null;
  /** One-finger moves that stay the page's; default `pan-y`, so that pages scroll. */
  declare touchAction: TouchAction | null;
  /** Leaves wheel and pinch to the page. */
  declare disableZoom: boolean;
  /** Keeps the camera's target where it is. */
  declare disablePan: boolean;
  /** Axis of the scene's frame that points up; default `-y`, as trainers write it. */
  declare up: 'x' | '-x' | 'y' | '-y' | 'z' | '-z' | null;
  /** Most drawn pixels for one CSS pixel; default no limit. */
  declare maxPixelRatio: number | string | null;
  /** Accuracy against speed: `reference`, `default`, `balanced` or `fast`. */
  declare quality: Quality | null;
  /** Contract of a generator: its URL, its JSON, or the object. Default: what is beside the model or in it. */
  declare contract: string | object | null;
  /** URLs, with spaces between them, of generators that each take the Gaussians of the one before, the first those of `src`. */
  declare chain: string | null;
  /** URL of a post-processor that makes the picture shown from the one drawn, or several with spaces between them. */
  declare postprocess: string | null;
  /** Seconds: where the scene's time is put whenever this changes. See {@link currentTime} for where it is. */
  declare time: number | string | null;
  /** Pose of a generator, flattened or nested, as its contract declares it: text, a list, a typed array. A new pose is a new object. */
  declare pose: Numbers | null;
  /** Starts again at the end. */
  declare loop: boolean;
  /** Controls of a generator by the names of its inputs; above the attributes `control-NAME`. New values are a new object. */
  declare controls: ControlValues | null;

  #attributes: Attributes;
  readonly #stage: Stage;
  readonly #internals: ElementInternals | null;
  #liveValues: Omit<LiveState, 'timeSeconds'> = { pose: undefined, controls: {}, pictures: {} };
  #controlObserver: MutationObserver | undefined;
  readonly #warned = new Set<string>();

  constructor() {
    super();
    // Boolean properties start as booleans: frameworks look at them to decide what a bare attribute means.
    this.cameraControls = false;
    this.disableZoom = false;
    this.disablePan = false;
    this.loop = false;
    this.#attributes = this.#readAttributes();
    this.#internals = isServer ? null : this.attachInternals();
    this.#stage = new Stage(this, {
      attributes: () => this.#attributes,
      input: () => ({
        enabled: this.cameraControls,
        zoom: !this.disableZoom,
        pan: !this.disablePan,
        touchAction: this.#attributes.touchAction,
      }),
      services: () => this.constructor as typeof GaussianSplatElement,
      loops: () => this.loop,
      liveValues: () => this.#liveValues,
      canvas: () => this.renderRoot?.querySelector('canvas') ?? null,
      surface: () => this.renderRoot?.querySelector<HTMLElement>('#view') ?? null,
    });
  }

  /** True while the scene is on show. */
  get loaded(): boolean {
    return this.#stage.scene.state === 'ready';
  }

  /**
   * Fulfils, and never rejects, when there is nothing left to wait for: the scene is on show ({@link loaded}), it cannot
   * be ({@link error}), or there is none. A lazy element that nobody scrolls to keeps one waiting.
   */
  get ready(): Promise<void> {
    return this.updateComplete.then(() => this.#stage.scene.settled);
  }

  /** Why no scene is shown, or null. */
  get error(): ElementError | null {
    return this.#stage.scene.error;
  }

  /** Size of the scene on show, or null. */
  get statistics(): SceneStatistics | null {
    const gaussians = this.#stage.scene.scene?.gaussians;
    if (!gaussians) return null;
    return { splats: gaussians.count, dropped: gaussians.droppedCount ?? 0, bytes: gaussians.byteLength };
  }

  /** Seconds into a scene that moves; setting it seeks. */
  get currentTime(): number {
    return this.#stage.playback.currentTime;
  }

  set currentTime(seconds: number) {
    this.#stage.playback.currentTime = seconds;
  }

  /** Seconds; NaN while there is no scene that moves, Infinity for one without an end. */
  get duration(): number {
    return this.#stage.playback.duration;
  }

  get paused(): boolean {
    return this.#stage.playback.paused;
  }

  get ended(): boolean {
    return this.#stage.playback.ended;
  }

  /** True until the frame of the time that was set is on show. */
  get seeking(): boolean {
    return this.#stage.playback.seeking;
  }

  /** Speed of the time; 1 is that of the clock, negative runs backwards. */
  get playbackRate(): number {
    return this.#stage.playback.playbackRate;
  }

  set playbackRate(rate: number) {
    this.#stage.playback.playbackRate = rate;
  }

  /**
   * Lets the time run, once the scene is there. Frames are drawn as the page has them; the generator follows as fast as it can.
   * @returns rejects with a `NotSupportedError` where there is no scene that moves.
   */
  async play(): Promise<void> {
    await this.ready;
    if (Number.isNaN(this.duration)) throw new DOMException('There is no scene that moves', 'NotSupportedError');
    this.#stage.playback.play();
  }

  pause(): void {
    this.#stage.playback.pause();
  }

  /** Where the camera is now; as a string, a value for `camera-orbit`. */
  getCameraOrbit(): CameraOrbit {
    return this.#stage.camera.orbit;
  }

  /** What the camera looks at now; as a string, a value for `camera-target`. */
  getCameraTarget(): CameraTarget {
    return this.#stage.camera.target;
  }

  /** Vertical field of view now; as a string, a value for `field-of-view`. */
  getFieldOfView(): FieldOfView {
    return this.#stage.camera.fieldOfView;
  }

  /** Ends the camera's motion where it was going. */
  jumpCameraToGoal(): void {
    this.#applyAttributes();
    this.#stage.camera.jumpToGoal();
  }

  /** Brings the camera back to where the attributes put it. */
  resetCamera(): void {
    this.#applyAttributes();
    this.#stage.camera.reset('none');
  }

  override focus(options?: FocusOptions): void {
    const surface = this.renderRoot?.querySelector<HTMLElement>('#view[tabindex]');
    if (surface) surface.focus(options);
    else super.focus(options);
  }

  override connectedCallback(): void {
    super.connectedCallback();
    // Names of controls are the model's: no list of observed attributes can hold them.
    this.#controlObserver ??= new MutationObserver((records) => {
      if (records.some(({ attributeName }) => attributeName?.startsWith(CONTROL_PREFIX))) this.requestUpdate();
    });
    this.#controlObserver.observe(this, { attributes: true });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#controlObserver?.disconnect();
  }

  protected override willUpdate(changed: PropertyValues<this>): void {
    this.#applyAttributes();
    if (isServer) return;
    this.#readLiveValues();
    if (changed.has('time')) this.#seekToAttribute();
  }

  protected override updated(): void {
    this.#stage.setSource(this);
    this.#showStates();
    const bar = this.renderRoot.querySelector<HTMLElement>('[part="progress-bar"]');
    // Through the style object, which a strict Content-Security-Policy allows, and not the attribute, which it refuses.
    if (bar) bar.style.transform = `scaleX(${this.#stage.progress ?? 0})`;
  }

  protected override render(): TemplateResult {
    const { state, error } = this.#stage.scene;
    return template({
      label: this.alt ?? this.getAttribute?.('aria-label') ?? DEFAULT_LABEL,
      controls: this.cameraControls,
      poster: this.poster,
      posterLoading: this.#attributes.loading,
      showPoster: state !== 'ready',
      isLoading: state === 'loading',
      progress: this.#stage.progress,
      error,
    });
  }

  /** Attributes count at once for those who call a method right after setting one. */
  #applyAttributes(): void {
    const before = this.#attributes;
    this.#attributes = this.#readAttributes();
    if (JSON.stringify(before.camera) !== JSON.stringify(this.#attributes.camera)) {
      this.#stage.camera.applySettings(this.#attributes.camera);
    }
  }

  #readAttributes(): Attributes {
    return readAttributes(this, (sentence) => this.#warn(sentence));
  }

  #readLiveValues(): void {
    const pose = readNumbers(this.pose);
    if (pose === undefined && this.pose) this.#warn('<gaussian-splat>: pose expects numbers; the rest pose counts.');
    this.#liveValues = { pose, ...readControls(this.attributes, this.controls, (sentence) => this.#warn(sentence)) };
  }

  #seekToAttribute(): void {
    const seconds = this.time === null || this.time === '' ? NaN : Number(this.time);
    if (Number.isFinite(seconds)) this.#stage.playback.currentTime = seconds;
    else if (this.time) this.#warn(`<gaussian-splat>: time expects seconds, found ${JSON.stringify(this.time)}.`);
  }

  #warn(sentence: string): void {
    if (this.#warned.has(sentence)) return;
    this.#warned.add(sentence);
    console.warn(sentence);
  }

  #showStates(): void {
    const { state, error } = this.#stage.scene;
    const active: Record<(typeof STATES)[number], boolean> = {
      loading: state === 'loading',
      ready: state === 'ready',
      error: error !== null,
      unsupported: error?.code === 'unsupported',
    };
    try {
      for (const name of STATES) this.#internals?.states[active[name] ? 'add' : 'delete'](name);
    } catch {
      // Browsers before :state() accept no plain names; only styling is lost.
    }
  }
}

// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export interface GaussianSplatElement {
  addEventListener<K extends keyof GaussianSplatEventMap>(
    type: K,
    listener: (this: GaussianSplatElement, event: GaussianSplatEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions,
  ): void;
  removeEventListener<K extends keyof GaussianSplatEventMap>(
    type: K,
    listener: (this: GaussianSplatElement, event: GaussianSplatEventMap[K]) => unknown,
    options?: boolean | EventListenerOptions,
  ): void;
  removeEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | EventListenerOptions,
  ): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'gaussian-splat': GaussianSplatElement;
  }
}
