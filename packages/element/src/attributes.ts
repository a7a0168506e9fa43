/**
 * The attributes of `<gaussian-splat>`, each in one place: its property's type, what Lit is told of it, its grammar, its default and what people read of it. The manifest
 * for editors and the table in README.md are made from this file (`scripts/attributes.mjs`). Kinds are called without options where their type says all.
 */
import type { ShDegree, SplatFilter } from '@gaussian-splat/core';
import type { Quality } from '@gaussian-splat/renderer';
import type { PropertyDeclaration, PropertyDeclarations } from 'lit';
import {
  angleGrammar,
  fieldOfViewGrammar,
  keywordGrammar,
  numberGrammar,
  orbitGrammar,
  readAttribute,
  targetGrammar,
  upGrammar,
  type AttributeGrammar,
} from './camera/grammar.js';
import type { CameraSettings } from './camera/settings.js';
import type { Numbers } from './live/values.js';
import type { SpokenStrings } from './words.js';

/** As much of a wait, ms, as timers can: whatever is longer, `Infinity` too, they take for none at all. */
export const timerMs = (wait: number): number => Math.min(wait, 2 ** 31 - 1);

/** When loading starts: once the element is in sight, or as soon as it is in the page. */
export type Loading = 'lazy' | 'eager';

/** One-finger moves that stay the page's. */
export type TouchAction = 'pan-y' | 'pan-x' | 'none' | 'auto' | 'manipulation';

/**
 * How far pictures may be off for being drawn from levels of detail: `auto` at rest not at all, and in motion where the GPU is too slow; `off` never; or, at
 * rest and in motion, as many pixels as the number says.
 */
export type DetailChoice = 'auto' | 'off' | number;

/** What pictures are drawn with: `auto` is the true image at rest and, in motion, as much of it as there is time for. */
export type QualityChoice = 'auto' | Quality;

/** The low-pass filter that a scene was trained with: `auto` is what its file says, or else `classic`. */
export type FilterChoice = 'auto' | SplatFilter;
/** What splats are ordered by. `auto`: what the file says, else their centres. */
export type OrderChoice = 'auto' | 'center' | 'pixel';
/** When the wheel zooms, and when it is the page's. */
export type WheelZoom = 'auto' | 'always' | 'ctrl' | 'none';

/** When the poster gives way: as soon as the scene can be drawn, or when the page says so. */
export type Reveal = 'auto' | 'manual';

/** Whether people are shown how to move the camera. */
export type InteractionPrompt = 'auto' | 'none';

/** `wiggle` turns the camera to and fro with the prompt; `basic` stands still. */
export type InteractionPromptStyle = 'wiggle' | 'basic';

/** What the camera does under a person's hands: turn around its target, or fly. */
export type Navigation = 'orbit' | 'fly';

/** One attribute, as the tables of elements list them. Only types know `P`, of the property, and `V`, of what is read of it: never where the element takes the property as it is. */
export interface Attribute<P, V = never> {
  readonly lit: PropertyDeclaration;
  readonly grammar?: AttributeGrammar<V>;
  readonly property?: P;
}

/** Taken as it is written. */
export const text = <P = string | null>(): Attribute<P> => ({ lit: {} });
/** On wherever it is written, but for `"false"`: what frameworks write that take it for an attribute with a value. */
export const flag = (): Attribute<boolean> => ({
  lit: {
    type: Boolean,
    converter: { fromAttribute: (value: string | null): boolean => value !== null && value !== 'false' },
  },
});
export const read = <V, P = string | null>(grammar: AttributeGrammar<V>): Attribute<P, V> => ({ lit: {}, grammar });
const number = <V>(grammar: AttributeGrammar<V>): Attribute<number | string | null, V> => ({ lit: {}, grammar });
/** The first is the default. */
const keyword = <V extends string>(words: readonly V[]): Attribute<V | null, V> => read(keywordGrammar(words));
/** `''` is what the bare attribute gives. */
export const bareKeyword = <V extends string>(words: readonly V[]): Attribute<V | '' | null, V> =>
  read(keywordGrammar(words));

const map = <A, B>(grammar: AttributeGrammar<A>, to: (value: A) => B): AttributeGrammar<B> => ({
  ...grammar,
  parse: (written) => {
    const value = grammar.parse(written);
    return value === null ? null : to(value);
  },
});
const milliseconds = (fallback: number): AttributeGrammar<number> =>
  map(numberGrammar(fallback, 0, 'milliseconds, 0 or more'), timerMs);
/** The renderer's own limit. */
const MOST_DETAIL_PIXELS = 64;
const detailGrammar: AttributeGrammar<DetailChoice> = {
  expected: `auto, off, or at most ${MOST_DETAIL_PIXELS} pixels such as 1px`,
  fallback: 'auto',
  parse: (written) => {
    const word = written.trim().toLowerCase();
    if (word === 'auto' || word === 'off') return word;
    const pixels = /^(\d+\.?\d*|\.\d+)px$/.test(word) ? parseFloat(word) : NaN;
    return pixels <= MOST_DETAIL_PIXELS ? pixels : null;
  },
};

export const ATTRIBUTES = {
  /**
   * URL of the scene. The property takes a local file as well: `element.src = file`, a `File` or `Blob`, which the browser keeps until the page goes. An object URL of your own does well to have
   * the name behind it, which tells a `.splat` for sure: `URL.createObjectURL(file) + '#' + encodeURIComponent(file.name)`.
   */
  src: text<string | Blob | null>(),
  /**
   * As of `<img>`: `use-credentials` sends cookies to other origins.
   * @default `anonymous`
   */
  crossorigin: bareKeyword(['anonymous', 'use-credentials']),
  /**
   * Text alternative; empty for decoration.
   * @default the host's `aria-label`, else "3D scene"
   */
  alt: text(),
  /** URL of an image shown until the scene is. */
  poster: text(),
  /**
   * `lazy` waits until the element is in sight, `eager` does not.
   * @default `lazy`
   */
  loading: keyword<Loading>(['lazy', 'eager']),
  /**
   * `auto`: the poster gives way as soon as the scene can be drawn. `manual` keeps it, and a lazy scene unloaded, until a click on it or `dismissPoster()`.
   * @default `auto`
   */
  reveal: keyword<Reveal>(['auto', 'manual']),
  /** Lets people orbit, pan and zoom with mouse, touch and keyboard. */
  cameraControls: flag(),
  /**
   * Theta, phi, radius: `deg` or `rad`; `m`, `cm`, `mm`, or `%` of the radius that frames the scene (all of a subject that stands alone, of others the 90 % of splats around the middle); `auto`, also
   * for what is left out at the end. As in `<model-viewer>`, but for `calc()` and `env()`. Setting it moves the camera, also when the value is the same as before. Where the camera goes: see `getCameraOrbit()`.
   * @default `0deg 75deg auto`
   */
  cameraOrbit: read(orbitGrammar('0deg 75deg auto')),
  /**
   * x y z in metres of viewer space (y up, right-handed); `auto` is the middle of the scene.
   * @default `auto`
   */
  cameraTarget: read(targetGrammar),
  /**
   * Least `camera-target`. Without this and `max-camera-target`, visitors pan within the radius that frames the scene.
   * @default `auto`: no limit
   */
  minCameraTarget: read(targetGrammar),
  /**
   * Greatest `camera-target`.
   * @default `auto`: no limit
   */
  maxCameraTarget: read(targetGrammar),
  /**
   * Vertical angle, such as `45deg`.
   * @default `auto` (45deg)
   */
  fieldOfView: read(fieldOfViewGrammar),
  /**
   * Views that visitors can choose from: JSON or, as a property, a list `[{ name, orbit, target, fieldOfView }]`; or the URL of such a file, of a trainer's `cameras.json`, or of the settings of SuperSplat. Children with `data-orbit` are views, too.
   */
  views: text<object | string | null>(),
  /**
   * Least `camera-orbit`.
   * @default `auto`: phi 22.5deg, radius 2 %
   */
  minCameraOrbit: read(orbitGrammar('auto')),
  /**
   * Greatest `camera-orbit`.
   * @default `auto`: phi 157.5deg, radius 500 %
   */
  maxCameraOrbit: read(orbitGrammar('auto')),
  /**
   * Least `field-of-view`.
   * @default `auto` (1deg)
   */
  minFieldOfView: read(fieldOfViewGrammar),
  /**
   * Greatest `field-of-view`.
   * @default `auto` (160deg)
   */
  maxFieldOfView: read(fieldOfViewGrammar),
  /**
   * Time constant of the camera's motion in milliseconds. 0, or a wish for less motion, jumps.
   * @default `50`
   */
  interpolationDecay: number(milliseconds(50)),
  /**
   * One-finger moves that stay the page's: `pan-y`, so that pages scroll, `pan-x`, `none`, `auto`, `manipulation`.
   * @default `pan-y`
   */
  touchAction: keyword<TouchAction>(['pan-y', 'pan-x', 'none', 'auto', 'manipulation']),
  /**
   * When the wheel zooms: `auto` with Ctrl, while the scene has the focus, or where there is nothing to scroll; `always`; `ctrl` with Ctrl only; `none`. At the zoom limit the page scrolls. Two fingers zoom in any case.
   * @default `auto`
   */
  zoom: keyword<WheelZoom>(['auto', 'always', 'ctrl', 'none']),
  /** Leaves the wheel and all that two fingers do to the page; keys do not zoom either. */
  disableZoom: flag(),
  /** Keeps the camera's target where it is. */
  disablePan: flag(),
  /** Ignores a double click and a double tap, which otherwise pick the point to turn around or, beside the scene, bring the camera back. */
  disableTap: flag(),
  /**
   * `orbit` turns around the target; `fly` looks around, and flies by W, A, S, D, Q and E, with Shift faster.
   * @default `orbit`
   */
  navigation: keyword<Navigation>(['orbit', 'fly']),
  /** Turns the camera around the scene until a visitor touches it. Off for visitors who want less motion, and while the scene has the keyboard; a button stops it. */
  autoRotate: flag(),
  /**
   * Rest before it turns, in milliseconds.
   * @default `3000`
   */
  autoRotateDelay: number(milliseconds(3_000)),
  /**
   * How fast it turns, such as `30deg`.
   * @default `5.625deg`
   */
  rotationPerSecond: read(angleGrammar('5.625deg')),
  /**
   * `auto` shows people who have not touched the scene that they can; `none` does not.
   * @default `auto`
   */
  interactionPrompt: keyword<InteractionPrompt>(['auto', 'none']),
  /**
   * `basic` stands still; `wiggle` moves the camera to and fro once, which draws frames.
   * @default `basic`
   */
  interactionPromptStyle: keyword<InteractionPromptStyle>(['basic', 'wiggle']),
  /**
   * Rest before the prompt is shown, in milliseconds.
   * @default `3000`
   */
  interactionPromptThreshold: number(milliseconds(3_000)),
  /**
   * Words in the page's own language, read or shown: JSON, or as a property an object, with the keys `front`, `upper-front`, `lower-front`, the same of `right`, `back` and `left`, `interaction-prompt`, `scene`, `role`, `keys-orbit`, `keys-fly`, `keys-views`,
   * `views`, `next-view`, `previous-view`, `show` (`…` stands for `alt`), `loading`, `reset`, `pause`, `play`, `details`, and `error-` before each of the codes of `error.code`. Without it the element's words are marked as English.
   * @default English
   */
  a11y: text<SpokenStrings | string | null>(),
  /**
   * What points up in the scene's frame: an axis, `x`, `-x`, `y`, `-y` (trainers write y down), `z`, `-z`, or a direction such as `0.1 -1 0.2` for a capture that is tilted; the playground finds it from three points of the floor. A
   * generator whose contract declares another axis has that one.
   * @default `-y`
   */
  up: read(upGrammar),
  /**
   * Most drawn pixels for each CSS pixel.
   * @default no limit
   */
  // Far below any ratio in use, so that 0 is refused but thumbnails of pixels are not.
  maxPixelRatio: number(numberGrammar(Infinity, 1 / 64, 'drawn pixels for each CSS pixel, above 0')),
  /**
   * Milliseconds of the GPU that a picture in motion may take with `quality="auto"`, where the page draws other things, too; else 0.8 of the display's interval, shared by the elements that draw at the same time.
   * @default the display's
   */
  frameBudget: number(numberGrammar(Infinity, 0.01, 'milliseconds, 0.01 or more')),
  /**
   * Accuracy against speed: `reference` (75 dB to the true image), `default` (59 dB, exact on a display), `balanced` (42 dB), `fast` (36 dB); `reference` fetches a scene again whose colours were rounded to 8 bits for the others; `auto` is `default` at
   * rest and, in motion, as much of it as there is time for.
   * @default `auto`
   */
  quality: keyword<QualityChoice>(['auto', 'default', 'reference', 'balanced', 'fast']),
  /**
   * Highest degree of spherical harmonics that colours are made of: 0, the same from everywhere, to 3. Whatever the file has beyond it is kept, but not evaluated.
   * @default `3`
   */
  maxShDegree: number(map(keywordGrammar(['3', '2', '1', '0']), (degree) => Number(degree) as ShDegree)),
  /**
   * The filter that the scene was trained with, for files that cannot say it: `classic` (0.3 px²), `antialiased` (0.3 px² with compensation: gsplat's and INRIA's options of that name), `mip`
   * (0.1 px² with compensation: Mip-Splatting, Brush's mip mode). Distant splats are too thin or too thick with another one.
   * @default `auto`: what the file says, else `classic`
   */
  filter: keyword<FilterChoice>(['auto', 'classic', 'antialiased', 'mip']),
  /**
   * What splats are ordered by: `center`, the depth of their centres, as most scenes are trained; `pixel`, at each pixel where along its ray a splat is densest. That does not pop when
   * the camera turns, is what scenes of StopThePop are trained with, and takes the GPU longer.
   * @default `auto`: what the file says, else `center`
   */
  order: keyword<OrderChoice>(['auto', 'center', 'pixel']),
  /**
   * Levels of detail: `auto` builds them where the GPU is too slow for the scene and draws them in motion alone; `off` never; pixels such as `1px` allow every frame an error of that size. Scenes that
   * come in levels (`detail.json`, `lod-meta.json`) are streamed: `auto` is `1px` for them, and with `off` a `lod-meta.json` is loaded whole.
   * @default `auto`
   */
  detail: read(detailGrammar),
  /**
   * Contract of a generator: a URL, its JSON, or as a property the object.
   * @default in the model or beside it
   */
  contract: text<string | object | null>(),
  /** URLs, with spaces between them, of generators that each take the Gaussians of the one before, the first those of `src`. */
  chain: text(),
  /**
   * `off`: the first run of a generator on the GPU is not compared with the same run on the CPU.
   * @default each model once on each adapter, when the page is idle
   */
  compare: text(),
  /** URL of a post-processor that makes the picture shown from the one drawn, or several with spaces between them. */
  postprocess: text(),
  /** Controls for visitors, made from what the generator or post-processor takes: sliders, a pose by its joints, pictures, the time. Style them by their parts. */
  controlsPanel: flag(),
  /** Seconds: where the scene's time is put whenever this changes. See `currentTime` for where it is. */
  time: text<number | string | null>(),
  /**
   * Pose of a generator, flattened or nested, as its contract declares it: text, a list, a typed array. A new pose is a new object.
   * @default the rest pose
   */
  pose: text<Numbers | null>(),
  /** Plays a scene that moves as soon as it is shown. Off for visitors who want less motion; a button stops it. */
  autoplay: flag(),
  /** Starts again at the end. */
  loop: flag(),
};

type Table = typeof ATTRIBUTES;
type Grammars = {
  [
    K in keyof Table as Table[K] extends { grammar?: AttributeGrammar<infer V> }
      ? [V] extends [never]
        ? never
        : K
      : never
  ]: Table[K];
};

/** The properties of all attributes. */
export type AttributeProperties = {
  -readonly [K in keyof Table]: Table[K] extends Attribute<infer P, unknown> ? P : never;
};

/** An attribute's raw value: text, or what a property was given instead. */
export type Raw = string | number | null | undefined;

/** The properties read here, by their attributes' camel-case names. */
export type RawAttributes = { readonly [K in keyof Grammars]: Raw };

/** All of them, read. */
export type Attributes = {
  readonly [K in keyof Grammars]: Grammars[K] extends { grammar?: AttributeGrammar<infer V> } ? V : never;
} & { readonly camera: CameraSettings };

const entries = Object.entries(ATTRIBUTES) as [keyof Table, Attribute<unknown, unknown>][];
const attributeOf = (property: string): string => property.replace(/[A-Z]/g, (letter) => `-${letter.toLowerCase()}`);

/** Fetch's word for it. */
export const credentialsOf = (crossorigin: Attributes['crossorigin']): RequestCredentials =>
  crossorigin === 'use-credentials' ? 'include' : 'same-origin';

/** What Lit is told of a table. */
export const declarations = (
  table: Readonly<Record<string, Attribute<unknown, unknown>>> = ATTRIBUTES,
): PropertyDeclarations =>
  Object.fromEntries(Object.entries(table).map(([name, { lit }]) => [name, { ...lit, attribute: attributeOf(name) }]));

/** The properties that are on or off. */
export const flags = entries.filter(([, { lit }]) => lit.type === Boolean).map(([name]) => name);

/** Reads all attributes; `warn` gets one sentence for each malformed one. */
export function readAttributes(raw: RawAttributes, warn: (sentence: string) => void): Attributes {
  const values = Object.fromEntries(
    entries.flatMap(([name, { grammar }]) =>
      grammar ? [[name, readAttribute(attributeOf(name), raw[name as keyof Grammars], grammar, warn)]] : [],
    ),
  ) as unknown as Omit<Attributes, 'camera'>;
  return {
    ...values,
    camera: {
      orbit: values.cameraOrbit,
      target: values.cameraTarget,
      minTarget: values.minCameraTarget,
      maxTarget: values.maxCameraTarget,
      fieldOfView: values.fieldOfView,
      minOrbit: values.minCameraOrbit,
      maxOrbit: values.maxCameraOrbit,
      minFieldOfView: values.minFieldOfView,
      maxFieldOfView: values.maxFieldOfView,
      up: values.up,
    },
  };
}
