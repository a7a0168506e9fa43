import { isServer, type PropertyValues, type ReactiveElement, type TemplateResult } from 'lit';
import { adoptStyles, styles } from './styles.js';
import { readAttributes, type Attributes } from './attributes.js';
import type { CameraSettings } from './camera/settings.js';
import { visitorMessage, type ElementError } from './errors.js';
import { SharedDevice } from './gpu/shared-device.js';
import { SceneLoader } from './loading/scene-loader.js';
import type { GeneratorInput } from './live/inputs.js';
import type { LiveState } from './live/live-model.js';
import type { SceneLimits } from './loading/protocol.js';
import { CONTROL_PREFIX, readControls, readNumbers } from './live/values.js';
import { Stage } from './stage.js';
import type { StageHost } from './stage-host.js';
import type { SceneStats } from './stats.js';
import { template } from './template.js';
import { ViewingMethods } from './viewing.js';
import { readSpokenStrings, type SpokenStrings } from './words.js';
import type { SoundProperties } from './live/sound-properties.js';
import type { ImmersiveMethods } from './xr/methods.js';

/** The properties that move the camera, and what each sets. */
const CAMERA_SETTINGS: ReadonlyMap<unknown, keyof CameraSettings> = new Map([
  ['cameraOrbit', 'orbit'],
  ['cameraTarget', 'target'],
  ['fieldOfView', 'fieldOfView'],
]);

/** Names of the custom states, for `gaussian-splat:state(ready)` in CSS. */
const STATES = ['loading', 'preview', 'ready', 'playing', 'error', 'unsupported'] as const;

/**
 * Shows a Gaussian splat scene.
 *
 * ```html
 * <gaussian-splat src="scene.ply" alt="A skull on a table" camera-controls></gaussian-splat>
 * ```
 *
 * @tagname gaussian-splat
 * @slot poster - Shown until the scene is.
 * @slot progress-bar - Shown while the scene loads.
 * @slot interaction-prompt - Shown to visitors who have not touched the scene yet.
 * @slot fallback - Shown if neither WebGPU nor WebGL 2 can draw the scene.
 * @slot error - Shown if the scene cannot be.
 * @slot view - Buttons of the page for its views, each with `data-orbit`.
 * @slot sound - An `<audio>` or `<video>` that is heard with a scene that moves; its captions are shown.
 * @slot hotspot-* - A label of the page at the point of the scene that its `data-position` names.
 * @csspart canvas - The frame.
 * @csspart poster - The image of the `poster` attribute.
 * @csspart poster-button - The button around it with `reveal="manual"`.
 * @csspart poster-cue - The sign in the middle of that button.
 * @csspart prompt - The default interaction prompt.
 * @csspart reset-button - Brings the camera back: shown to visitors who have moved it with their fingers.
 * @csspart views - The bar of the views.
 * @csspart view-name - The name of the present view in it.
 * @csspart previous-view - Its button for the view before.
 * @csspart next-view - Its button for the next view.
 * @csspart pause-button - The visitor's button for what `auto-rotate` and `autoplay` move.
 * @csspart progress-track - The progress bar's ground.
 * @csspart progress-bar - The progress bar.
 * @csspart controls-panel - The panel of the attribute `controls-panel`.
 * @csspart controls-scene - the group of controls of a `<splat-scene>`, a `fieldset`
 * @csspart control - A control in it, with its label.
 * @csspart control-label - The label.
 * @csspart control-input - The slider, field or button.
 * @csspart control-value - The number beside a slider.
 * @csspart captions - Lines of the captions of the sound.
 * @csspart fallback - The default text if neither WebGPU nor WebGL 2 can draw the scene.
 * @csspart error - The default text after an error.
 * @cssproperty [--poster-fit=cover] - `object-fit` of the poster.
 * @cssproperty [--poster-transition=0.3s] - How long the poster fades.
 * @cssproperty --progress-bar-color - Colour of the progress bar.
 * @cssproperty --progress-track-color - Colour behind it.
 * @cssproperty [--progress-bar-height=4px] - Its height.
 * @cssproperty [--interaction-prompt-display=flex] - `none` hides the interaction prompt.
 * @cssproperty --interaction-prompt-background - Ground of the default prompt.
 * @cssproperty --interaction-prompt-color - Its colour.
 * @cssproperty [--pause-button-display=block] - `none` takes the pause button away: for pages that bring a control of their own.
 * @cssproperty [--reset-button-display=block] - `none` takes the reset button away.
 * @cssproperty [--views-display=flex] - `none` takes the bar of the views away.
 * @cssproperty [--min-hotspot-opacity=0.25] - Opacity of hotspots that are hidden.
 * @cssproperty [--max-hotspot-opacity=1] - Opacity of the others.
 * @cssproperty --captions-background - Ground of captions.
 * @cssproperty --captions-color - Their color.
 * @cssproperty --captions-font - Their font.
 * @cssproperty --message-background - Ground of the default texts.
 * @cssproperty --message-color - Their colour.
 * @cssproperty --message-font - Their font.
 * @cssstate loading - Bytes are on their way.
 * @cssstate preview - A part of the scene is visible while the rest loads.
 * @cssstate ready - The scene is shown.
 * @cssstate playing - Its time runs.
 * @cssstate error - It cannot be shown.
 * @cssstate unsupported - Neither WebGPU nor WebGL 2 can draw the scene in this browser.
 * @fires {CustomEvent<LoadDetail>} load - The first frame is drawn.
 * @fires {ProgressEvent} progress - Bytes have arrived.
 * @fires {CustomEvent<PreviewDetail>} preview - A part of the scene is visible while the rest loads.
 * @fires {CustomEvent<ElementError>} error - The scene cannot be shown; `detail` is the same object as the property `error`.
 * @fires {CustomEvent<GaussianSplatError>} shader-error - The function of `splatShader` does not compile; `detail` names the line. The scene is drawn without it.
 * @fires {CustomEvent<CameraChangeDetail>} camera-change - The camera has moved; `detail.source` says who moved it.
 * @fires {CustomEvent<ViewChangeDetail>} view-change - The camera sets out for a view of the list.
 * @fires {CustomEvent<WalkReadyDetail>} walk-ready - Fired when the floor of `navigation="walk"` is known and the camera stands on it.
 * @fires {CustomEvent<ImmersiveStatusDetail>} vr-status - VR can be started, has started, is over, or failed.
 * @fires {CustomEvent<ImmersiveStatusDetail>} ar-status - The same for AR; the object stands in the room.
 * @fires {CustomEvent<MeasureDetail>} measure - A visitor has measured a length.
 * @fires {Event} poster-dismissed - The poster has given way to the scene.
 * @fires {CustomEvent<VisibilityDetail>} model-visibility - The element has come into sight, or left it.
 * @fires {CustomEvent<ElementError>} generator-error - A run of the generator failed; the last good frame stays.
 * @fires {Event} inputs-change - The inputs that the page may set are others; `inputs` has them.
 * @fires {CustomEvent<FallbackDetail>} generator-fallback - The generator runs on the CPU; `detail.reason` says why.
 * @fires {Event} play - As of HTMLMediaElement, like those that follow.
 * @fires {Event} playing - The time runs.
 * @fires {Event} waiting - The clip plays, and the frames of this time have not arrived.
 * @fires {Event} pause - The time stands still.
 * @fires {Event} timeupdate - The time has gone on.
 * @fires {Event} seeking - Another time was asked for.
 * @fires {Event} seeked - It is shown.
 * @fires {Event} ended - The time has come to its end.
 * @fires {Event} ratechange - The speed of the time has changed.
 * @fires {Event} volumechange - The sound in the slot `sound` is louder, quieter, muted, or another one.
 * @fires {Event} durationchange - The length of the time is known.
 * @fires {Event} loadedmetadata - Likewise.
 * @fires {Event} loadstart - Loading has begun.
 * @fires {Event} loadeddata - The first frame is there.
 * @fires {Event} canplay - Likewise.
 * @fires {Event} emptied - The scene was taken away.
 * @fires {Event} contextlost - The GPU device was lost; the element recovers by itself.
 * @fires {Event} contextrestored - The frame is back.
 */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class GaussianSplatElement extends ViewingMethods {
  /** The GPU device of all elements. A page with a device of its own may put `new SharedDevice(...)` here beforehand. */
  static sharedDevice = new SharedDevice();
  /** Loads the scenes of all elements. */
  static sceneLoader = new SceneLoader(undefined, () => GaussianSplatElement.workerLocation);
  /** How long a removed element keeps its scene, in milliseconds: moving it within the page costs nothing. */
  static releaseDelay = 1_000;
  /**
   * Bytes of GPU memory that one scene may take; a larger one is refused with `out-of-memory/budget` before any of it is allocated. null, the
   * default: half of the memory that the browser says the device has (`navigator.deviceMemory`); where it does not say, 512 MB on touch screens, else no limit. All
   * scenes of a page together may take the default, or this if it is more.
   */
  static memoryBudget: number | null = null;
  /**
   * What one load may cost, for pages whose visitors choose the scenes: `{ maxSplats, maxBytes, maxSeconds }`. More is refused with `out-of-memory/budget` before it is allocated. Default
   * of `maxBytes`, memory of the page in which the file counts double: eight times {@link memoryBudget}, 4 GiB at most. `origins` are other servers that manifests may name files on.
   */
  static sceneLimits: SceneLimits = {};
  /** Folder of the files of onnxruntime-web 1.30.0, which generators need; null for `onnxruntime/` beside the bundle. */
  static runtimeLocation: string | null = null;
  /** Address of `scene-worker.js`. With null, the default, the npm package starts its worker from a blob URL, and the CDN build loads the file next to its script. Set it before the first scene is loaded. */
  static workerLocation: string | null = null;
  /** Rewrites the absolute addresses of all scenes before they are fetched: for signed URLs and mirrors. */
  static urlModifier: ((url: string) => string) | null = null;

  static override styles = styles;

  #attributes: Attributes;
  readonly #internals: ElementInternals | null;
  #liveValues: Omit<LiveState, 'timeSeconds'> = { pose: undefined, controls: {}, pictures: {} };
  #strings: SpokenStrings = {};
  /** What the page has set of the camera since it was last applied. */
  readonly #set = new Set<keyof CameraSettings>();
  #controlObserver: MutationObserver | undefined;
  readonly #warned = new Set<string>();
  /** @internal */
  protected readonly stage: Stage;

  constructor() {
    super();
    this.#attributes = this.#readAttributes();
    this.#internals = (!isServer && this.attachInternals?.()) || null;
    this.stage = new Stage(this, GaussianSplatElement.#hostOf(this));
  }

  /** True while the scene is shown. */
  get loaded(): boolean {
    return this.stage.sources.state === 'ready';
  }

  /**
   * Fulfils, and never rejects, when there is nothing left to wait for: the scene is shown ({@link loaded}), it cannot
   * be ({@link error}), or there is none. A lazy element that is never scrolled to keeps one waiting.
   */
  get ready(): Promise<void> {
    return this.updateComplete.then(() => this.stage.settled).then(() => undefined);
  }

  /**
   * Share of the loading that is done, 0..1; 0 too while its size is not known. Of a generator: the bytes of its models and of ONNX Runtime are three
   * quarters, warming up is the rest.
   */
  get progress(): number {
    return this.loaded ? 1 : (this.stage.sources.progress ?? 0);
  }

  /** Why no scene is shown, or null. */
  get error(): ElementError | null {
    return this.stage.sources.error;
  }

  /** What the page may set of the models that are shown, from their contracts: for your own controls. Empty without a model; `inputs-change` tells of others. */
  get inputs(): readonly GeneratorInput[] {
    return this.stage.inputs;
  }

  /**
   * What is computed, drawn, seen and in memory, what frames are drawn with, and why; null where no scene is shown. Counts of the frame are those of
   * the last {@link updateStats}.
   */
  get stats(): SceneStats | null {
    return this.stage.stats;
  }

  /** Counts what the frame shown draws and what of it can be seen. Asks the GPU and draws the view once more: for panels, not for every frame. */
  updateStats(): Promise<SceneStats | null> {
    return this.stage.updateStats();
  }

  /** Gives the keyboard to the scene, where the camera can be moved; else as of HTMLElement. */
  override focus(options?: FocusOptions): void {
    const surface = this.renderRoot?.querySelector<HTMLElement>('#view[tabindex]');
    if (surface) surface.focus(options);
    else super.focus(options);
  }

  override connectedCallback(): void {
    super.connectedCallback();
    // Names of controls are the model's: no list of observed attributes can hold them. Lit observes those of its own properties.
    this.#controlObserver ??= new MutationObserver((records) => {
      const counts = (name: string | null): boolean => name === 'aria-label' || !!name?.startsWith(CONTROL_PREFIX);
      if (!records.some(({ attributeName }) => counts(attributeName))) return;
      this.requestUpdate();
      this.stage.requestFrame();
    });
    this.#controlObserver.observe(this, { attributes: true });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#controlObserver?.disconnect();
  }

  /** Style sheets stay behind in the document that made them, and so does the image where that has lost its window. */
  adoptedCallback(from: Document): void {
    if (this.shadowRoot) adoptStyles(this.shadowRoot);
    if (from.defaultView === null) this.stage.leaveWindowless();
  }

  /** `moveBefore()` takes the element elsewhere as it is: its being here lets the browser spare both callbacks above. */
  connectedMoveCallback(): void {
    this.requestUpdate();
  }

  protected override createRenderRoot(): HTMLElement | DocumentFragment {
    // What a server put into a declarative shadow root gives way, in the same task, to the element's own first rendering.
    if (!isServer) this.shadowRoot?.replaceChildren();
    if (isServer || this.ownerDocument === document) return super.createRenderRoot();
    // Lit's style sheets are of the document that this code runs in: others refuse them.
    const root = this.shadowRoot ?? this.attachShadow(GaussianSplatElement.shadowRootOptions);
    adoptStyles(root);
    return root;
  }

  protected override willUpdate(changed: PropertyValues<this>): void {
    this.applyAttributes();
    if (isServer) return;
    this.#readLiveValues();
    if (changed.has('a11y')) this.#readStrings();
    if (changed.has('time')) this.#seekToAttribute();
  }

  protected override updated(changed: PropertyValues<this>): void {
    if (changed.size > 0) this.stage.requestFrame();
    this.#showStates();
    const bar = this.renderRoot.querySelector<HTMLElement>('[part="progress-bar"]');
    // Through the style object, which a strict Content-Security-Policy allows, and not the attribute, which it refuses.
    if (bar) bar.style.transform = `scaleX(${this.stage.sources.progress ?? 0})`;
  }

  protected override render(): TemplateResult {
    const { sources, reveal, behaviours, labels } = this.stage;
    const { state, progress, hasPicture } = sources;
    // One of several scenes that fails leaves the others visible.
    const error = hasPicture ? null : this.stage.sources.error;
    const { prompt, promptWiggles, announcer, motion } = behaviours;
    return template({
      label: this.alt ?? this.getAttribute?.('aria-label') ?? null,
      canMove: this.cameraControls && error === null,
      navigation: this.#attributes.navigation,
      walkKeys: this.stage.walk.value?.keys,
      poster: this.poster,
      posterLoading: this.#attributes.loading,
      showPoster: reveal.isCovered,
      onReveal: reveal.mayReveal ? null : this.#onReveal,
      isLoading: state === 'loading',
      progress,
      error,
      hasPoster: this.#hasPoster,
      prompt: !prompt?.isShown ? 'none' : promptWiggles ? 'wiggle' : 'basic',
      motionView: motion.value?.view,
      onReset: this.stage.offersReset ? this.#onReset : null,
      strings: this.#strings,
      spoken: error ? this.#spokenError(error) : (announcer.value?.text ?? ''),
      hotspots: labels.value?.names ?? [],
      handsView: this.stage.handsView,
    });
  }

  /** What the stage knows of an element. */
  static #hostOf(element: GaussianSplatElement): StageHost {
    return {
      source: element,
      get attributes() {
        return element.#attributes;
      },
      get services() {
        return element.constructor as typeof GaussianSplatElement;
      },
      get strings() {
        return element.#strings;
      },
      get liveValues() {
        return element.#liveValues;
      },
      part: <T extends HTMLElement>(selector: string) => element.renderRoot?.querySelector<T>(selector) ?? null,
      warn: (sentence) => element.#warn(sentence),
    };
  }

  /** The page's own words, where it has some; none for a poster that stands in for the scene. */
  #spokenError(error: ElementError): string {
    const isUnsupported = error.code === 'unsupported';
    const own = this.#slotted(isUnsupported ? 'fallback' : 'error')?.textContent.trim();
    return own || (isUnsupported && this.#hasPoster ? '' : visitorMessage(error, this.#strings));
  }

  get #hasPoster(): boolean {
    return !!this.poster || this.#slotted('poster') !== null;
  }

  #slotted(name: string): Element | null {
    return this.querySelector?.(`:scope > [slot=${name}]`) ?? null;
  }

  /** A person clicked the poster: the keyboard goes on in the scene. */
  readonly #onReveal = (): void => {
    this.dismissPoster();
    void this.updateComplete.then(() => this.focus());
  };

  readonly #onReset = (): void => {
    this.stage.act({ type: 'reset' });
    // The button goes.
    this.focus({ preventScroll: true });
  };

  /** Lit passes over a value that is set again; where the camera goes, it counts: a bookmark works twice. */
  override requestUpdate(...request: Parameters<ReactiveElement['requestUpdate']>): void {
    const setting = CAMERA_SETTINGS.get(request[0]);
    if (setting === undefined) return super.requestUpdate(...request);
    this.#set.add(setting);
    super.requestUpdate();
  }

  /** Attributes count at once for those who call a method right after setting one. */
  protected override applyAttributes(): void {
    const before = this.#attributes;
    this.#attributes = this.#readAttributes();
    if (this.#set.size > 0 || JSON.stringify(before.camera) !== JSON.stringify(this.#attributes.camera)) {
      this.stage.camera.applySettings(this.#attributes.camera, this.#set);
      this.#set.clear();
    }
  }

  #readAttributes(): Attributes {
    return readAttributes(this, (sentence) => this.#warn(sentence));
  }

  #readLiveValues(): void {
    const pose = readNumbers(this.pose);
    if (pose === undefined && this.pose) this.#warn('<gaussian-splat>: pose expects numbers; the rest pose counts.');
    this.#liveValues = { pose, ...readControls(this.attributes, this.inputValues, (sentence) => this.#warn(sentence)) };
  }

  #readStrings(): void {
    const strings = readSpokenStrings(this.a11y);
    if (strings === null) this.#warn('<gaussian-splat>: a11y expects a JSON object of words; the English ones count.');
    this.#strings = strings ?? {};
  }

  /** The attribute `time`; NaN where it says nothing. */
  get #startTime(): number {
    return this.time === null || this.time === '' ? NaN : Number(this.time);
  }

  #seekToAttribute(): void {
    const seconds = this.#startTime;
    if (Number.isFinite(seconds)) {
      // A scene that is still to come begins there anyway.
      if (this.stage.playback.canPlay && !this.stage.sources.own.isLeaving) this.currentTime = seconds;
    } else if (this.time) this.#warn(`<gaussian-splat>: time expects seconds, found ${JSON.stringify(this.time)}.`);
  }

  #warn(sentence: string): void {
    if (this.#warned.has(sentence)) return;
    this.#warned.add(sentence);
    console.warn(sentence);
  }

  #showStates(): void {
    const { state, error } = this.stage.sources;
    const active: Record<(typeof STATES)[number], boolean> = {
      loading: state === 'loading',
      preview: this.stage.sources.own.scene.isPreview,
      ready: state === 'ready',
      playing: !this.paused,
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

/** Methods of VR and AR come with their code. */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging, @typescript-eslint/no-empty-object-type
export interface GaussianSplatElement extends ImmersiveMethods, SoundProperties {}

declare global {
  interface HTMLElementTagNameMap {
    'gaussian-splat': GaussianSplatElement;
  }
}
