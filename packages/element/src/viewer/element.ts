import { loadModule } from '@gaussian-splat/core';
import { isServer, nothing, type PropertyValues, type ReactiveElement, type TemplateResult } from 'lit';
import { adoptStyles, styles } from './styles.js';
import type { Attributes, FeatureMembers } from './attributes.js';
import { readAttributes } from './element-attributes.js';
import FEATURES from './feature-table.js';
import type { CameraSettings } from './camera/settings.js';
import { visitorMessage, type ElementError } from './errors.js';
import { SharedDevice } from '../gpu/shared-device.js';
import { SceneLoader } from '../loading/scene-loader.js';
import type { GeneratorInput } from '../sources/generator/inputs.js';
import type { SceneLimits } from '../loading/protocol.js';
import { CONTROL_PREFIX, readControls, readNumbers } from '../sources/generator/values.js';
import { Viewer } from './viewer.js';
import type { SceneStats } from './stats.js';
import { template, type TemplateModel } from './template.js';
import { ViewingMethods } from './viewing.js';
import { readSpokenStrings, type A11yStrings } from './strings.js';

/** The properties that move the camera, and the setting of each. */
const CAMERA_SETTINGS: ReadonlyMap<unknown, keyof CameraSettings> = new Map([
  ['cameraOrbit', 'orbit'],
  ['cameraTarget', 'target'],
  ['fieldOfView', 'fieldOfView'],
]);

/** Returns the language of a node: of its nearest ancestor with `lang`, which may be outside of its shadow tree. */
function languageAt(node: HTMLElement): string {
  // The root of a removed element may be a link, whose `host` is a text.
  const { host } = node.getRootNode() as Partial<ShadowRoot>;
  return node.closest<HTMLElement>('[lang]')?.lang ?? (host?.closest ? languageAt(host as HTMLElement) : '');
}

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
 * @slot fallback - Shown if neither WebGPU nor WebGL 2 can draw the scene.
 * @slot error - Shown if the scene cannot be displayed.
 * @csspart canvas - The frame.
 * @csspart poster - The image of the `poster` attribute.
 * @csspart poster-button - The button around it with `reveal="manual"`.
 * @csspart poster-icon - The play symbol in the center of that button.
 * @csspart progress-track - The background of the progress bar.
 * @csspart progress-bar - The progress bar.
 * @csspart controls-panel - The panel of the attribute `controls-panel`.
 * @csspart controls-group - The group of controls of a `<splat-scene>`, a `fieldset`.
 * @csspart control - A control in it, with its label.
 * @csspart control-label - The label of a control.
 * @csspart control-input - The slider, field or button of a control.
 * @csspart control-value - The number beside a slider.
 * @csspart fallback - The default text if neither WebGPU nor WebGL 2 can draw the scene.
 * @csspart error - The default text after an error.
 * @cssproperty [--poster-fit=cover] - `object-fit` of the poster.
 * @cssproperty [--poster-transition=0.3s] - Duration of the poster's fade.
 * @cssproperty --progress-bar-color - Color of the progress bar.
 * @cssproperty --progress-track-color - Background color of the progress bar.
 * @cssproperty [--progress-bar-height=4px] - Height of the progress bar.
 * @cssproperty --message-background - Background of the default texts.
 * @cssproperty --message-color - Text color of the default texts.
 * @cssproperty --message-font - Font of the default texts.
 * @cssstate loading - The scene is loading.
 * @cssstate preview - A part of the scene is visible while the rest loads.
 * @cssstate ready - The scene is shown.
 * @cssstate playing - The animation is playing.
 * @cssstate error - The scene cannot be displayed.
 * @cssstate unsupported - Neither WebGPU nor WebGL 2 can draw the scene in this browser.
 * @fires {CustomEvent<LoadDetail>} load - Fired when the first frame is drawn.
 * @fires {ProgressEvent} progress - Fired when bytes have arrived.
 * @fires {CustomEvent<PreviewDetail>} preview - Fired when a part of the scene becomes visible while the rest loads.
 * @fires {CustomEvent<ElementError>} error - Fired when the scene cannot be displayed; `detail` is the same object as the property `error`.
 * @fires {CustomEvent<CameraChangeDetail>} camera-change - Fired when the camera has moved; `detail.source` is what moved it.
 * @fires {Event} poster-dismissed - Fired when the poster is dismissed.
 * @fires {CustomEvent<VisibilityDetail>} model-visibility - Fired when the element enters or leaves the viewport.
 * @fires {CustomEvent<ElementError>} generator-error - Fired when a run of the generator fails; the last valid frame stays.
 * @fires {Event} inputs-change - Fired when the set of inputs available to the page changes; `inputs` lists them.
 * @fires {CustomEvent<GeneratorMemoryDetail>} generator-memory - Fired once before the first run of a generator; `detail` contains the bytes of its weights, of its Gaussians, and of the largest tensor of known size.
 * @fires {CustomEvent<FallbackDetail>} generator-fallback - Fired when the generator runs on the CPU; `detail.reason` contains the reason.
 * @fires {Event} play - Fired when playback is requested, as by HTMLMediaElement; so are the following events.
 * @fires {Event} playing - Fired when playback starts or resumes.
 * @fires {Event} waiting - Fired when playback stops because the frames of the current time have not arrived.
 * @fires {Event} pause - Fired when playback is paused.
 * @fires {Event} timeupdate - Fired when the current time changes.
 * @fires {Event} seeking - Fired when a seek starts.
 * @fires {Event} seeked - Fired when the sought time is shown.
 * @fires {Event} ended - Fired when playback reaches the end.
 * @fires {Event} ratechange - Fired when the playback rate changes.
 * @fires {Event} volumechange - Fired when the sound in the slot `sound` changes its volume, is muted, or is replaced.
 * @fires {Event} durationchange - Fired when the duration becomes known or changes.
 * @fires {Event} loadedmetadata - Fired when the duration becomes known.
 * @fires {Event} loadstart - Fired when loading starts.
 * @fires {Event} loadeddata - Fired when the first frame is available.
 * @fires {Event} canplay - Fired when the first frame is available and playback can start.
 * @fires {Event} canplaythrough - Fired after `canplay`, because the element does not estimate download times.
 * @fires {Event} emptied - Fired when the scene is removed.
 * @fires {Event} contextlost - Fired when the GPU device is lost; the element recovers automatically.
 * @fires {Event} contextrestored - Fired when the image is restored after a lost device.
 */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class GaussianSplatElement extends ViewingMethods {
  /** The GPU device of all elements. A page with its own device may set `new SharedDevice(...)` here first. */
  static sharedDevice = new SharedDevice();
  /** Loads the scenes of all elements. */
  static sceneLoader = new SceneLoader(undefined, () => GaussianSplatElement.workerLocation);
  /** Milliseconds that a removed element keeps its scene, so that moving it within the page costs nothing. */
  static releaseDelay = 1_000;
  /**
   * Upper limit of the GPU memory of one scene in bytes; a larger one is rejected with `out-of-memory/budget` before
   * anything is allocated. null, the default: half of the device memory that the browser reports
   * (`navigator.deviceMemory`); if it reports none, 512 MB on touch screens, else no limit. All scenes of a page
   * together may take the default, or this if it is more.
   */
  static memoryBudget: number | null = null;
  /**
   * Limits of one load, for pages whose visitors choose the scenes: `{ maxSplats, maxBytes, maxSeconds }`. Larger loads
   * are rejected with `out-of-memory/budget` before the allocation. `maxBytes` limits CPU memory, and each file counts
   * twice; its default is eight times {@link memoryBudget}, at most 4 GiB. `origins` are other servers that manifests
   * may refer to.
   */
  static sceneLimits: SceneLimits = {};
  /** Folder of the files of onnxruntime-web 1.30.0, which generators need; null for `onnxruntime/` beside the bundle. */
  static runtimeLocation: string | null = null;
  /** Address of `scene-worker.js`. With null, the default, the npm package starts its worker from a blob URL, and the CDN build loads the file next to its script. Set it before the first scene is loaded. */
  static workerLocation: string | null = null;
  /** Rewrites the absolute addresses of all scenes before they are fetched: for signed URLs and mirrors. */
  static urlModifier: ((url: string) => string) | null = null;

  static override styles = styles;

  readonly #internals: ElementInternals | null;
  /** Words in the language of the page. */
  #words: A11yStrings = {};
  #lang = '';
  /** Camera attributes that the page has set since they were last applied. */
  readonly #set = new Set<keyof CameraSettings>();
  #controlObserver: MutationObserver | undefined;
  readonly #warned = new Set<string>();
  /** @internal */
  protected readonly core: Viewer;

  constructor() {
    super();
    this.#internals = (!isServer && this.attachInternals?.()) || null;
    this.core = new Viewer(this, FEATURES, this.#readAttributes(), {
      source: this,
      services: this.constructor as typeof GaussianSplatElement,
      part: <T extends HTMLElement>(selector: string) => this.renderRoot?.querySelector<T>(selector) ?? null,
      warn: (sentence) => this.#warn(sentence),
    });
  }

  /** Whether the scene is shown; without `src`, whether all children have loaded or failed, and one is shown. */
  get loaded(): boolean {
    return this.core.sources.isLoaded;
  }

  /**
   * Resolves, and never rejects, when nothing is pending: the scene is shown ({@link loaded}), it failed ({@link
   * error}), or there is none. A lazy element that never enters the viewport stays pending.
   */
  get ready(): Promise<void> {
    return this.updateComplete.then(() => this.core.settled).then(() => undefined);
  }

  /**
   * Loading progress, 0..1; 0 while the size is unknown. For a generator the bytes of its models and of ONNX Runtime
   * are three quarters, warm-up is the rest.
   */
  get progress(): number {
    return this.loaded ? 1 : (this.core.sources.progress ?? 0);
  }

  /** Reason that no scene is shown, or null. */
  get error(): ElementError | null {
    return this.core.sources.error;
  }

  /**
   * Inputs of the current models that the page may set, from their contracts, for your own controls. Empty without a
   * model; `inputs-change` reports changes.
   */
  get inputs(): readonly GeneratorInput[] {
    return this.core.inputs;
  }

  /**
   * Statistics of splats, memory, quality and backend, with reasons; null if no scene is shown. Counts of the frame are
   * those of the last {@link updateStats}.
   */
  get stats(): SceneStats | null {
    return this.core.stats;
  }

  /**
   * Counts the drawn and the visible splats of the current frame. Reads back from the GPU and draws the view once more:
   * call it for panels, not for every frame.
   */
  updateStats(): Promise<SceneStats | null> {
    return this.core.updateStats();
  }

  /** Focuses the scene if the camera can be moved; otherwise same as on HTMLElement. */
  override focus(options?: FocusOptions): void {
    const surface = this.renderRoot?.querySelector<HTMLElement>('#view[tabindex]');
    if (surface) surface.focus(options);
    else super.focus(options);
  }

  override connectedCallback(): void {
    super.connectedCallback();
    // The model defines the names of controls, so they cannot be listed in observedAttributes. Lit observes its own
    // properties.
    this.#controlObserver ??= new MutationObserver((records) => {
      const counts = (name: string | null): boolean =>
        name === 'aria-label' || name === 'lang' || !!name?.startsWith(CONTROL_PREFIX);
      if (!records.some(({ attributeName }) => counts(attributeName))) return;
      this.requestUpdate();
      this.core.requestFrame();
    });
    this.#controlObserver.observe(this, { attributes: true });
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#controlObserver?.disconnect();
  }

  /** Style sheets do not move to another document, and neither does the frame if its document has lost its window. */
  adoptedCallback(from: Document): void {
    if (this.shadowRoot) adoptStyles(this.shadowRoot);
    if (from.defaultView === null) this.core.view.renewCanvas();
  }

  /** `moveBefore()` moves the element with its state: this callback replaces the two above. */
  connectedMoveCallback(): void {
    this.requestUpdate();
  }

  protected override createRenderRoot(): HTMLElement | DocumentFragment {
    // Server-rendered content of a declarative shadow root is replaced, in the same task, by the element's own first
    // rendering.
    if (!isServer) this.shadowRoot?.replaceChildren();
    if (isServer || this.ownerDocument === document) return super.createRenderRoot();
    // Lit's style sheets belong to the document of this script, and others reject them.
    const root = this.shadowRoot ?? this.attachShadow(GaussianSplatElement.shadowRootOptions);
    adoptStyles(root);
    return root;
  }

  protected override willUpdate(changed: PropertyValues<this>): void {
    this.applyAttributes();
    if (isServer) return;
    this.#readDynamicValues();
    const lang = languageAt(this);
    if (lang !== this.#lang) this.#speak((this.#lang = lang)).catch((error: Error) => this.#warn(error.message));
    if (changed.has('a11y')) this.#readStrings();
    if (changed.has('time')) this.#seekToAttribute();
  }

  protected override updated(changed: PropertyValues<this>): void {
    if (changed.size > 0) this.core.requestFrame();
    this.#showStates();
    const bar = this.renderRoot.querySelector<HTMLElement>('[part="progress-bar"]');
    // Set through the style object, which a strict Content-Security-Policy allows, unlike the attribute.
    if (bar) bar.style.transform = `scaleX(${this.#loading ?? 0})`;
  }

  /** Progress of what is loading, 0..1; null while unknown, undefined if nothing is. */
  get #loading(): number | null | undefined {
    const { sources, features } = this.core;
    return sources.state === 'loading' ? sources.progress : features.first('progress');
  }

  protected override render(): TemplateResult {
    const { attributes, strings, sources, reveal, features, announcer } = this.core;
    const { hasImage } = sources;
    // If one of several scenes fails, the others stay visible.
    const error = hasImage ? null : sources.error;
    const model: TemplateModel = {
      label: this.alt ?? this.getAttribute?.('aria-label') ?? null,
      canMove: this.cameraControls && error === null,
      poster: this.poster,
      posterLoading: attributes.loading,
      showPoster: reveal.isCovered,
      onReveal: reveal.mayReveal ? null : this.#onReveal,
      isLoading: this.#loading !== undefined,
      progress: this.#loading ?? null,
      error,
      hasPoster: this.#hasPoster,
      strings,
      spoken: error ? this.#spokenError(error) : (announcer.value?.text ?? ''),
      slots: features.call('slots').flat(),
    };
    const parts = features.call('view', model).map((part) => part ?? nothing);
    return template(model, parts);
  }

  /** The page's own text, if there is one; none for a poster that replaces the scene. */
  #spokenError(error: ElementError): string {
    const isUnsupported = error.code === 'unsupported';
    const own = this.#slotted(isUnsupported ? 'fallback' : 'error')?.textContent.trim();
    return own || (isUnsupported && this.#hasPoster ? '' : visitorMessage(error, this.core.strings));
  }

  get #hasPoster(): boolean {
    return !!this.poster || this.#slotted('poster') !== null;
  }

  #slotted(name: string): Element | null {
    return this.querySelector?.(`:scope > [slot=${name}]`) ?? null;
  }

  /** A visitor clicked the poster, so the keyboard focus moves to the scene. */
  readonly #onReveal = (): void => {
    this.dismissPoster();
    void this.updateComplete.then(() => this.focus());
  };

  /** Lit ignores a value that is set again; for the camera it counts, so that a bookmark works twice. */
  override requestUpdate(...request: Parameters<ReactiveElement['requestUpdate']>): void {
    const setting = CAMERA_SETTINGS.get(request[0]);
    if (setting === undefined) return super.requestUpdate(...request);
    this.#set.add(setting);
    super.requestUpdate();
  }

  /** Attributes apply at once for code that calls a method right after setting one. */
  protected override applyAttributes(): void {
    const before = this.core.attributes.camera;
    const { camera } = (this.core.attributes = this.#readAttributes());
    if (this.#set.size > 0 || JSON.stringify(before) !== JSON.stringify(camera)) {
      this.core.camera.applySettings(camera, this.#set);
      this.#set.clear();
    }
  }

  #readAttributes(): Attributes {
    return readAttributes(this, (sentence) => this.#warn(sentence));
  }

  #readDynamicValues(): void {
    const pose = readNumbers(this.pose);
    if (pose === undefined && this.pose) this.#warn('<gaussian-splat>: pose expects numbers; the rest pose counts.');
    this.core.dynamicValues = {
      pose,
      ...readControls(this.attributes, this.inputValues, (sentence) => this.#warn(sentence)),
    };
  }

  #readStrings(): void {
    const strings = readSpokenStrings(this.a11y);
    if (strings === null) this.#warn('<gaussian-splat>: a11y expects a JSON object of words; the English ones count.');
    this.core.strings = { ...this.#words, ...strings };
  }

  /** Uses the language of the page as soon as its strings are loaded. */
  async #speak(lang: string): Promise<void> {
    const words = /^(en\b|$)/i.test(lang)
      ? {}
      : await loadModule('the words of this language', async () => (await import('./languages.js')).wordsIn(lang));
    if (lang !== this.#lang) return;
    this.#words = words;
    this.#readStrings();
    this.requestUpdate();
  }

  /** The attribute `time`; NaN if it is absent. */
  get #startTime(): number {
    return this.time === null || this.time === '' ? NaN : Number(this.time);
  }

  #seekToAttribute(): void {
    const seconds = this.#startTime;
    if (Number.isFinite(seconds)) {
      // A pending scene starts there anyway.
      if (this.core.playback.canPlay && !this.core.sources.ownEntry.isLeaving) this.currentTime = seconds;
    } else if (this.time) this.#warn(`<gaussian-splat>: time expects seconds, found ${JSON.stringify(this.time)}.`);
  }

  #warn(sentence: string): void {
    if (this.#warned.has(sentence)) return;
    this.#warned.add(sentence);
    console.warn(sentence);
  }

  #showStates(): void {
    const { state, error } = this.core.sources;
    const active: Record<(typeof STATES)[number], boolean> = {
      loading: state === 'loading',
      preview: this.core.sources.ownEntry.scene.isPreview,
      ready: state === 'ready',
      playing: !this.paused,
      error: error !== null,
      unsupported: error?.code === 'unsupported',
    };
    try {
      for (const name of STATES) this.#internals?.states[active[name] ? 'add' : 'delete'](name);
    } catch {
      // Browsers before :state() reject plain names; only styling is lost.
    }
  }
}

/** Members that features add with their code. */
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export interface GaussianSplatElement extends FeatureMembers {}

declare global {
  interface HTMLElementTagNameMap {
    'gaussian-splat': GaussianSplatElement;
  }
}
