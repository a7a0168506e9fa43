/**
 * The attributes of `<gaussian-splat>`, each defined once: its property's type, its declaration for Lit, its grammar,
 * its default, an example, and its documentation. The manifest for editors and docs/guide/attributes.md are generated
 * from this file (`scripts/attributes.mjs`). Grammars without parameters are referenced by name.
 */
import type { ShDegree, SplatFilter } from '@gaussian-splat/core';
import type { Quality } from '@gaussian-splat/renderer';
import type { PropertyDeclarations } from 'lit';
import {
  bareKeyword,
  flag,
  keyword,
  map,
  milliseconds,
  number,
  read,
  text,
  type Attribute,
  type AttributeTable,
  type PropertiesOf,
} from './attribute.js';
import {
  fieldOfViewGrammar,
  keywordGrammar,
  numberGrammar,
  orbitGrammar,
  targetGrammar,
  upGrammar,
  type AttributeGrammar,
} from './camera/grammar.js';
import type { CameraSettings } from './camera/settings.js';
import type { Numbers } from '../sources/generator/values.js';
import type { A11yStrings } from './strings.js';

/** Start of loading: when the element enters the viewport, or as soon as it is connected. */
export type Loading = 'lazy' | 'eager';

/** One-finger gestures that are left to the page. */
export type TouchAction = 'pan-y' | 'pan-x' | 'none' | 'auto' | 'manipulation';

/**
 * Error that levels of detail may cause: `auto` none at rest, and while moving as much as the GPU requires; `off` none;
 * or a number of pixels, at rest and while moving.
 */
export type DetailChoice = 'auto' | 'off' | number;

/** Accuracy of frames: `auto` is `default` at rest, and lower while moving if the GPU requires it. */
export type QualityChoice = 'auto' | Quality;

/** The low-pass filter of a scene's training: `auto` is that of its file, or else `classic`. */
export type FilterChoice = 'auto' | SplatFilter;
/** Rendering backend: `auto` is WebGPU if the browser supports it, else WebGL 2. */
export type RendererChoice = 'auto' | 'webgpu' | 'webgl';
/** Sort order of splats. `auto`: that of the file, else their centers. */
export type OrderChoice = 'auto' | 'center' | 'pixel' | 'distance';
/** Conditions under which the wheel zooms instead of scrolling the page. */
export type WheelZoom = 'auto' | 'always' | 'ctrl' | 'none';

/** Dismissal of the poster: as soon as the scene can be drawn, or by the page. */
export type Reveal = 'auto' | 'manual';

/** Kinds of camera motion that features add. Their rows extend this interface. */
export interface FeatureNavigations {}

/** Camera motion under a visitor's control: orbit around its target, or that of a feature. */
export type Navigation = 'orbit' | keyof FeatureNavigations;

/** The renderer's own limit. */
const MAX_DETAIL_PIXELS = 64;
const detailGrammar: AttributeGrammar<DetailChoice> = {
  expected: `auto, off, or at most ${MAX_DETAIL_PIXELS} pixels such as 1px`,
  fallback: 'auto',
  parse: (written) => {
    const word = written.trim().toLowerCase();
    if (word === 'auto' || word === 'off') return word;
    const pixels = /^(\d+(\.\d*)?|\.\d+)px$/.test(word) ? parseFloat(word) : NaN;
    return pixels <= MAX_DETAIL_PIXELS ? pixels : null;
  },
};

export const ATTRIBUTES = {
  /**
   * URL of the scene: a file, a sequence, a clip, a streamed folder, or a generator. The property takes a local `File` or `Blob` as well. Put the name of a
   * `.splat` behind an object URL: `URL.createObjectURL(file) + '#' + encodeURIComponent(file.name)`.
   * @example src="garden.spz"
   */
  src: text<string | Blob | null>(),
  /**
   * Same as on `<img>`: `use-credentials` sends cookies to other origins.
   * @default `anonymous`
   * @example crossorigin="use-credentials"
   */
  crossorigin: bareKeyword(['anonymous', 'use-credentials']),
  /**
   * Text alternative. Leave it empty for decoration.
   * @default the `aria-label` of the element, else "3D scene"
   * @example alt="Our garden in June"
   */
  alt: text(),
  /**
   * URL of an image that is shown until the scene is.
   * @example poster="garden.webp"
   */
  poster: text(),
  /**
   * `lazy` waits until the element enters the viewport. `eager` loads at once.
   * @default `lazy`
   * @example loading="eager"
   */
  loading: keyword<Loading>(['lazy', 'eager']),
  /**
   * `auto` hides the poster as soon as the scene can be drawn. `manual` keeps it until a click on it or `dismissPoster()`; a lazy scene is not loaded
   * before.
   * @default `auto`
   * @example reveal="manual"
   */
  reveal: keyword<Reveal>(['auto', 'manual']),
  /**
   * Lets visitors orbit, pan and zoom with mouse, touch and keyboard.
   * @example camera-controls
   */
  cameraControls: flag(),
  /**
   * Theta, phi and radius. Angles have `deg` or `rad`. The radius has `m`, `cm`, `mm`, or `%` of the radius that frames
   * the scene: a single subject as a whole, else the central 90 % of the splats. Each may be `auto`, and trailing
   * values may be omitted. The syntax is that of `<model-viewer>`, without `calc()` and `env()`. Setting it moves the
   * camera, also to the same value. `getCameraOrbit()` returns the current position. `auto` is `0deg 75deg 100%`, within the limits
   * that the scene's file recommends; for a captured room a view from within, if `camera-target` is `auto`, too.
   * @default `auto`
   * @example camera-orbit="30deg 75deg 120%"
   */
  cameraOrbit: read(orbitGrammar('auto')),
  /**
   * The point that the camera looks at: x y z in meters of viewer space (y up, right-handed). `auto` is the center of
   * the scene.
   * @default `auto`
   * @example camera-target="0m 1.2m 0m"
   */
  cameraTarget: read(targetGrammar),
  /**
   * Lower limit of `camera-target`. Without this and `max-camera-target`, visitors pan within the radius that frames
   * the scene.
   * @default `auto`: no limit
   * @example min-camera-target="-2m 0m -2m"
   */
  minCameraTarget: read(targetGrammar),
  /**
   * Upper limit of `camera-target`.
   * @default `auto`: no limit
   * @example max-camera-target="2m 3m 2m"
   */
  maxCameraTarget: read(targetGrammar),
  /**
   * Vertical angle of view.
   * @default `auto` (45deg)
   * @example field-of-view="30deg"
   */
  fieldOfView: read(fieldOfViewGrammar),
  /**
   * Shows the scene by parallel rays, as plans do: nothing gets smaller with its distance. Zooming scales the image.
   * @example orthographic
   */
  orthographic: flag(),
  /**
   * Lower limit of `camera-orbit`.
   * @default `auto`: phi 22.5deg, radius 2 %
   * @example min-camera-orbit="auto 45deg 50%"
   */
  minCameraOrbit: read(orbitGrammar('auto')),
  /**
   * Upper limit of `camera-orbit`.
   * @default `auto`: phi 157.5deg, radius 500 %
   * @example max-camera-orbit="auto 90deg 200%"
   */
  maxCameraOrbit: read(orbitGrammar('auto')),
  /**
   * Lower limit of `field-of-view`.
   * @default `auto` (1deg)
   * @example min-field-of-view="15deg"
   */
  minFieldOfView: read(fieldOfViewGrammar),
  /**
   * Upper limit of `field-of-view`.
   * @default `auto` (160deg)
   * @example max-field-of-view="60deg"
   */
  maxFieldOfView: read(fieldOfViewGrammar),
  /**
   * How slowly the camera follows: a time constant in milliseconds. `0` jumps. It always jumps for visitors who ask for less motion.
   * @default `50`
   * @example interpolation-decay="200"
   */
  interpolationDecay: number(milliseconds(50)),
  /**
   * One-finger gestures that are left to the page: `pan-y` (scrolling up and down), `pan-x`, `none`, `auto`, `manipulation`.
   * @default `pan-y`
   * @example touch-action="none"
   */
  touchAction: keyword<TouchAction>(['pan-y', 'pan-x', 'none', 'auto', 'manipulation']),
  /**
   * When the wheel zooms. `auto`: with Ctrl, while the scene has the focus, or if the page does not scroll. `always`;
   * `ctrl`: with Ctrl only; `none`. At the limit of the zoom the page scrolls. Two fingers zoom in any case.
   * @default `auto`
   * @example zoom="always"
   */
  zoom: keyword<WheelZoom>(['auto', 'always', 'ctrl', 'none']),
  /**
   * Leaves the wheel and all two-finger gestures to the page. The keys do not zoom either.
   * @example disable-zoom
   */
  disableZoom: flag(),
  /**
   * Keeps visitors from panning, so that the camera target does not move.
   * @example disable-pan
   */
  disablePan: flag(),
  /**
   * Ignores double clicks and double taps. On the scene they set the target of the camera, beside it they bring the camera back.
   * @example disable-tap
   */
  disableTap: flag(),
  /**
   * Length of one unit of the scene's file, with `m`, `cm` or `mm`. Without it, that of the file applies (OpenUSD's `metersPerUnit`). If the file has none, walking and VR take a unit for one meter, and rulers show numbers alone.
   * @default that of the file, else unknown
   * @example unit="37cm"
   */
  unit: text(),
  /**
   * The words of the element in the language of the page: JSON or, as a property, an object. Keys: `front`, `upper-front`, `lower-front`, the same three
   * of `right`, `back` and `left`; `scene`, `role`, `interaction-prompt`, `keys-orbit`, `keys-fly`, `keys-walk`, `keys-views`; `views`, `next-view`, `previous-view`;
   * `vr`, `ar`, `exit-ar`, `ar-simplified`, `measure`, `measure-keys`, `measure-first`, `measure-none`, `measure-unclear`;
   * `controls-panel`, `controls-reset`, `controls-time`, `controls-joint`, `controls-group`;
   * `show` (`…` stands for `alt`), `loading`, `blocked`, `reset`, `pause`, `play`, `details`; and `error-` before each `error.code`. Without it the words are
   * those of the language that `lang` names: English, German, Spanish, French, Japanese, Korean, Portuguese, Russian or Chinese.
   * @default by `lang`
   * @example a11y='{ "pause": "Anhalten", "play": "Abspielen" }'
   */
  a11y: text<A11yStrings | string | null>(),
  /**
   * Up direction in the axes of the file: `x`, `-x`, `y`, `-y` (as in training), `z`, `-z`, or a vector such as `0.1 -1
   * 0.2` for a tilted capture. The playground finds it from three points of the floor.
   * @default that of the file or contract, else `-y`
   * @example up="y"
   */
  up: read(upGrammar),
  /**
   * Upper limit of device pixels rendered per CSS pixel.
   * @default no limit
   * @example max-pixel-ratio="1"
   */
  // Far below any ratio in use, so that 0 is rejected but thumbnails of pixels are not.
  maxPixelRatio: number(numberGrammar(Infinity, 1 / 64, 'drawn pixels for each CSS pixel, above 0')),
  /**
   * Milliseconds of GPU time for a frame while moving, with `quality="auto"`: for pages that draw other things on the GPU. By default the elements that
   * draw at the same time share 0.8 of the interval of the display.
   * @default 0.8 of the display's interval
   * @example frame-budget="4"
   */
  frameBudget: number(numberGrammar(Infinity, 0.01, 'milliseconds, 0.01 or more')),
  /**
   * Accuracy against speed, as PSNR to the reference image: `reference` (75 dB), `default` (59 dB, no difference on a
   * display), `balanced` (42 dB), `fast` (36 dB). `auto` is `default` at rest; while moving it goes lower if the GPU
   * needs it. `reference` loads a scene again if its colors were rounded to 8 bits.
   * @default `auto`
   * @example quality="balanced"
   */
  quality: keyword<QualityChoice>(['auto', 'default', 'reference', 'balanced', 'fast']),
  /**
   * Rendering backend. `auto` uses WebGPU, or WebGL 2 (scene files only) in browsers without it; `webgpu` and `webgl`
   * force one and fail otherwise.
   * @default `auto`
   * @example renderer="webgl"
   */
  renderer: keyword<RendererChoice>(['auto', 'webgpu', 'webgl']),
  /**
   * Maximum degree of spherical harmonics, 0 to 3. With 0 colors do not depend on the view.
   * @default `3`
   * @example max-sh-degree="0"
   */
  maxShDegree: number(map(keywordGrammar(['3', '2', '1', '0']), (degree) => Number(degree) as ShDegree)),
  /**
   * The low-pass filter that the scene was trained with, for files that do not contain it: `classic` (0.3 px²),
   * `antialiased` (0.3 px² with compensation: the options of that name of gsplat and INRIA), `mip` (0.1 px² with
   * compensation: Mip-Splatting, mip mode of Brush). With a wrong filter distant splats look too thin or too thick.
   * @default `auto`: according to the file, else `classic`
   * @example filter="antialiased"
   */
  filter: keyword<FilterChoice>(['auto', 'classic', 'antialiased', 'mip']),
  /**
   * Sort key of the splats. `center`: the depth of their centers, as in the training of most scenes. `distance`: their
   * distance from the eye, which does not change when the camera turns, so that nothing pops, but which differs from
   * training. `pixel`: at each pixel the point of its ray with the splat's maximum density. This does not pop when the
   * camera turns, fits scenes that StopThePop trained, and takes more GPU time.
   * @default `auto`: according to the file, else `center`
   * @example order="pixel"
   */
  order: keyword<OrderChoice>(['auto', 'center', 'pixel', 'distance']),
  /**
   * Levels of detail. `auto` builds them if the GPU is too slow for the scene, and draws them only during motion. `off`
   * builds none. Pixels such as `1px` allow this error in every frame. Streamed scenes (`detail.json`,
   * `lod-meta.json`, `tileset.json`, `.lcc`, `.lcc2`, `.rad`) contain levels: `auto` is `1px` for them, and `off` loads
   * all but a `detail.json` completely at once.
   * @default `auto`
   * @example detail="2px"
   */
  detail: read(detailGrammar),
  /**
   * Contract of a generator: a URL or its JSON. The property takes the object as well.
   * @default in the model or beside it
   * @example contract="walker.contract.json"
   */
  contract: text<string | object | null>(),
  /**
   * URLs of generators, with spaces between them. Each takes the Gaussians of the one before, the first those of `src`.
   * @example chain="relight.onnx"
   */
  chain: text(),
  /**
   * `off`: the first run of a generator on the GPU is not compared with the same run on the CPU.
   * @default each model once on each adapter, when the page is idle
   * @example gpu-check="off"
   */
  gpuCheck: text(),
  /**
   * URL of a post-processor that turns each drawn frame into another image, or several URLs with spaces between them.
   * @example postprocess="style.onnx"
   */
  postprocess: text(),
  /**
   * Shows controls for the inputs of the generator or post-processor: sliders, joints, images, the time. Style them by
   * their parts.
   * @example controls-panel
   */
  controlsPanel: flag(),
  /**
   * Playback position in seconds: each change seeks. `currentTime` returns the current position.
   * @example time="1.5"
   */
  time: text<number | string | null>(),
  /**
   * Pose of a generator, flattened or nested, as its contract declares it: text, a list, or a typed array. A new pose is a new object.
   * @default the rest pose
   * @example pose="0 0.3 0"
   */
  pose: text<Numbers | null>(),
  /**
   * Plays a scene that moves as soon as it is shown. It does not start for visitors who ask for less motion. A button stops it.
   * @example autoplay
   */
  autoplay: flag(),
  /**
   * Starts again at the end.
   * @example loop
   */
  loop: flag(),
};

/** Methods and properties that features add with their code. Their rows extend this interface. */
export interface FeatureMembers {}

/** Attributes of features. The rows of the table extend this interface. */
export interface FeatureAttributes {}

/** The own attributes of the element, and those of its features: see element-attributes.ts. */
type Table = typeof ATTRIBUTES & FeatureAttributes;
/** The properties of all attributes. */
export type AttributeProperties = PropertiesOf<Table>;

/** An attribute's raw value: text, or the value of the property. */
export type Raw = string | number | null | undefined;

/** All properties, as the page has set them. */
export type RawAttributes = { readonly [K in keyof Table]: unknown };

/** The parsed values: by their grammars, or the raw ones. */
export type Attributes = {
  readonly [K in keyof Table]: Table[K] extends Attribute<infer P, infer V> ? ([V] extends [never] ? P : V) : never;
} & { readonly camera: CameraSettings };

/** Name of the attribute of a property. */
export const attributeOf = (property: string): string =>
  property.replace(/[A-Z]/g, (letter) => `-${letter.toLowerCase()}`);

/** Converts to Fetch's option. */
export const credentialsOf = (crossorigin: Attributes['crossorigin']): RequestCredentials =>
  crossorigin === 'use-credentials' ? 'include' : 'same-origin';

/** Returns the property declarations that Lit needs for a table of attributes. */
export const declarations = (table: AttributeTable): PropertyDeclarations =>
  Object.fromEntries(Object.entries(table).map(([name, { lit }]) => [name, { ...lit, attribute: attributeOf(name) }]));
