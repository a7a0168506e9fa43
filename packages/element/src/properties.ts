import { LitElement, type PropertyDeclarations } from 'lit';
import type { SpokenStrings } from './words.js';
import type { GaussianSplatEventMap } from './events.js';
import type { ControlValues, Numbers } from './live/values.js';

/** On wherever it is written, but for `"false"`: what frameworks write that take it for an attribute with a value. */
const flag = { fromAttribute: (value: string | null): boolean => value !== null && value !== 'false' };

/** The attributes of `<gaussian-splat>` and their properties, keywords written out for editors. What their text means is in attributes.ts. */
// The interface below only gives inherited methods their types: nothing in it could be missing at run time.
// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export class SplatProperties extends LitElement {
  static override properties: PropertyDeclarations = {
    src: {},
    crossorigin: {},
    poster: {},
    alt: {},
    loading: {},
    cameraControls: { type: Boolean, converter: flag, attribute: 'camera-controls' },
    cameraOrbit: { attribute: 'camera-orbit' },
    cameraTarget: { attribute: 'camera-target' },
    fieldOfView: { attribute: 'field-of-view' },
    minCameraOrbit: { attribute: 'min-camera-orbit' },
    maxCameraOrbit: { attribute: 'max-camera-orbit' },
    minFieldOfView: { attribute: 'min-field-of-view' },
    maxFieldOfView: { attribute: 'max-field-of-view' },
    interpolationDecay: { attribute: 'interpolation-decay' },
    touchAction: { attribute: 'touch-action' },
    disableZoom: { type: Boolean, converter: flag, attribute: 'disable-zoom' },
    disablePan: { type: Boolean, converter: flag, attribute: 'disable-pan' },
    up: {},
    maxPixelRatio: { attribute: 'max-pixel-ratio' },
    frameBudget: { attribute: 'frame-budget' },
    quality: {},
    maxShDegree: { attribute: 'max-sh-degree' },
    detail: {},
    contract: {},
    chain: {},
    postprocess: {},
    time: {},
    pose: {},
    loop: { type: Boolean, converter: flag },
    controls: { attribute: false },
    reveal: {},
    navigation: {},
    autoRotate: { type: Boolean, converter: flag, attribute: 'auto-rotate' },
    autoRotateDelay: { attribute: 'auto-rotate-delay' },
    rotationPerSecond: { attribute: 'rotation-per-second' },
    interactionPrompt: { attribute: 'interaction-prompt' },
    interactionPromptStyle: { attribute: 'interaction-prompt-style' },
    interactionPromptThreshold: { attribute: 'interaction-prompt-threshold' },
    disableTap: { type: Boolean, converter: flag, attribute: 'disable-tap' },
    autoplay: { type: Boolean, converter: flag },
    a11y: {},
    // Accessors of MediaProperties: named here so that what a page sets before the element is defined reaches them.
    currentTime: { attribute: false, noAccessor: true },
    playbackRate: { attribute: false, noAccessor: true },
  };

  /** URL of the scene file; the property may be a local file itself, which the browser then keeps until the page goes. */
  declare src: string | Blob | null;
  /** As of `<img>`: `use-credentials` sends cookies to other origins. */
  declare crossorigin: 'anonymous' | 'use-credentials' | '' | null;
  /** URL of an image shown until the scene is. */
  declare poster: string | null;
  /** Text alternative. Absent: the host's `aria-label`, else "3D scene". Empty: the scene is decorative. */
  declare alt: string | null;
  /** `lazy`, the default, loads once the element is in sight; `eager` at once. */
  declare loading: 'lazy' | 'eager' | null;
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
  declare touchAction: 'pan-y' | 'pan-x' | 'none' | 'auto' | 'manipulation' | null;
  /** Leaves the wheel and all that two fingers do to the page; keys do not zoom either. */
  declare disableZoom: boolean;
  /** Keeps the camera's target where it is. */
  declare disablePan: boolean;
  /** What points up in the scene's frame: `x`, `-x`, `y`, `-y` (the default, as trainers write it, where a generator's contract declares nothing else), `z`, `-z`, or a direction such as `0.1 -1 0.2` for a capture that is tilted. */
  declare up: string | null;
  /** Most drawn pixels for one CSS pixel; default no limit. */
  declare maxPixelRatio: number | string | null;
  /** Milliseconds of the GPU that a picture in motion may take with `quality="auto"`; default 0.8 of the display's interval, shared by the elements that draw at the same time. */
  declare frameBudget: number | string | null;
  /**
   * Accuracy against speed. `auto`, the default: `default` at rest and, in motion, as much of it as the display leaves time for. `reference`, `default`,
   * `balanced`, `fast`: always that.
   */
  declare quality: 'auto' | 'default' | 'reference' | 'balanced' | 'fast' | null;
  /** Highest degree of spherical harmonics that colours are made of, 0 to 3; default 3. The file's own are kept. */
  declare maxShDegree: number | string | null;
  /**
   * Levels of detail. `auto`, the default: built from the scene where the GPU is too slow for it, and drawn in motion alone. `off`: never. Pixels such as `1px`: what
   * is drawn, at rest too, may be displaced by so many for having been merged.
   */
  declare detail: string | null;
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
  /** `auto`, the default: the poster gives way as soon as the scene can be drawn. `manual`: when {@link dismissPoster} or a click says so. */
  declare reveal: 'auto' | 'manual' | null;
  /** `orbit`, the default, turns around the target; `fly` looks around and flies by W, A, S, D, Q and E. */
  declare navigation: 'orbit' | 'fly' | null;
  /** Turns the camera around the scene while nobody touches it; not for people who want less motion. */
  declare autoRotate: boolean;
  /** Rest before it turns, in milliseconds; default 3000. */
  declare autoRotateDelay: number | string | null;
  /** How fast it turns, such as `30deg`; default `5.625deg`. */
  declare rotationPerSecond: string | null;
  /** `auto`, the default, shows people who have not touched the scene that they can; `none` does not. */
  declare interactionPrompt: 'auto' | 'none' | null;
  /** `basic`, the default, stands still; `wiggle` moves the camera to and fro once. */
  declare interactionPromptStyle: 'basic' | 'wiggle' | null;
  /** Rest before the prompt is shown, in milliseconds; default 3000. */
  declare interactionPromptThreshold: number | string | null;
  /** Keeps the camera's target where it is on a double click or a double tap, which otherwise pick the point to turn around. */
  declare disableTap: boolean;
  /** Plays a scene that moves as soon as it is on show; not for people who want less motion. */
  declare autoplay: boolean;
  /** Words for screen readers, and of messages, in place of the English ones: an object or its JSON, with the keys of {@link SpokenStrings}. */
  declare a11y: SpokenStrings | string | null;

  constructor() {
    super();
    // Boolean properties start as booleans: frameworks look at them to decide what a bare attribute means.
    this.cameraControls = false;
    this.disableZoom = false;
    this.disablePan = false;
    this.disableTap = false;
    this.autoRotate = false;
    this.autoplay = false;
    this.loop = false;
  }
}

// eslint-disable-next-line @typescript-eslint/no-unsafe-declaration-merging
export interface SplatProperties {
  addEventListener<K extends keyof GaussianSplatEventMap>(
    type: K,
    listener: (this: this, event: GaussianSplatEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions,
  ): void;
  removeEventListener<K extends keyof GaussianSplatEventMap>(
    type: K,
    listener: (this: this, event: GaussianSplatEventMap[K]) => unknown,
    options?: boolean | EventListenerOptions,
  ): void;
  removeEventListener(
    type: string,
    listener: EventListenerOrEventListenerObject,
    options?: boolean | EventListenerOptions,
  ): void;
}
