/**
 * The attributes of `<gaussian-splat>`, each defined once: its property's type, its declaration for Lit, its grammar,
 * its default, an example, and its documentation. The manifest for editors and docs/guide/attributes.md are generated
 * from this file (`scripts/attributes.mjs`). Grammars without parameters are referenced by name.
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
import type { Numbers } from '../sources/generator/values.js';
import type { A11yStrings } from './strings.js';

/** Limits a delay in ms to the maximum of timers, which treat longer ones, even `Infinity`, as 0. */
export const timerMs = (wait: number): number => Math.min(wait, 2 ** 31 - 1);

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

/** Whether visitors are shown how to move the camera. */
export type InteractionPrompt = 'auto' | 'none';

/** `wiggle` swings the camera with the prompt; `basic` keeps it still. */
export type InteractionPromptStyle = 'wiggle' | 'basic';

/** Camera motion under a visitor's control: orbit around its target, fly, or walk on the floor. */
export type Navigation = 'orbit' | 'fly' | 'walk';

/**
 * One attribute, as in the tables of elements. The types `P` of the property and `V` of the parsed value exist only at
 * compile time; `V` is never if the element uses the property directly.
 */
export interface Attribute<P, V = never> {
  readonly lit: PropertyDeclaration;
  readonly grammar?: AttributeGrammar<V>;
  readonly property?: P;
}

/** Used as written. */
export const text = <P = string | null>(): Attribute<P> => ({ lit: {} });
/** True if present, except for `"false"`, because some frameworks write it as an attribute with a value. */
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
/** `''` is the value of the bare attribute. */
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
   * How the scene appears: `fade`, `grow` from its center, `sweep` along an axis (`x`, `-y` ...), or `detail`, from coarse to fine while it loads; with a time such as `2s`. Visitors who
   * ask for less motion see it at once. The property `revealProgress`, 0 to 1, drives it by hand.
   * @default `none`
   * @example reveal-effect="sweep y 2s"
   */
  revealEffect: text(),
  /**
   * Lets visitors orbit, pan and zoom with mouse, touch and keyboard.
   * @example camera-controls
   */
  cameraControls: flag(),
  /**
   * Theta, phi and radius. Angles have `deg` or `rad`. The radius has `m`, `cm`, `mm`, or `%` of the radius that frames
   * the scene: a single subject as a whole, else the central 90 % of the splats. Each may be `auto`, and trailing
   * values may be omitted. The syntax is that of `<model-viewer>`, without `calc()` and `env()`. Setting it moves the
   * camera, also to the same value. `getCameraOrbit()` returns the current position. `auto` is `0deg 75deg 100%`, within
   * the limits that the scene's file recommends.
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
   * Named views that visitors can choose from. Either JSON (as a property, a list), `[{ name, orbit, target, fieldOfView }]`, or the URL of such a file,
   * of `cameras.json` of a trainer, or of the settings of SuperSplat. Children with `data-orbit` are views, too.
   * @example views='[{ "name": "Front", "orbit": "0deg 75deg 100%" }]'
   */
  views: text<object | string | null>(),
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
   * `orbit` turns around the target. `fly` looks around, and moves with W, A, S, D, Q and E, faster with Shift. `walk` stays on the floor, which the element finds
   * in the splats: with W, A, S, D or the arrow keys, a click or a tap on the floor, a stick for the thumb, or a gamepad.
   * @default `orbit`
   * @example navigation="walk"
   */
  navigation: keyword<Navigation>(['orbit', 'fly', 'walk']),
  /**
   * URL of a map of the floor for `navigation="walk"`, written by `gaussian-splat floor`, or of voxels (`.voxel.json`) of splat-transform. `auto` makes one from the splats after the scene has loaded.
   * @default `auto`
   * @example walk-map="garden.floor"
   */
  walkMap: text(),
  /**
   * Height of a walker's eyes above the floor, with `m`, `cm` or `mm`.
   * @default `1.6m`
   * @example eye-height="1.2m"
   */
  eyeHeight: text(),
  /**
   * Length of one unit of the scene's file, with `m`, `cm` or `mm`. Without it, walking and VR take a unit for one meter, and rulers show numbers alone.
   * @default unknown
   * @example unit="37cm"
   */
  unit: text(),
  /**
   * Offers VR if the browser has a headset: a button, which the slot `vr-button` replaces, and `activateVR()`.
   * @example vr
   */
  vr: flag(),
  /**
   * Offers AR if the browser supports it: a button, which the slot `ar-button` replaces, and `activateAR()`. The
   * subject of the scene stands on the real floor.
   * @example ar
   */
  ar: flag(),
  /**
   * How AR is shown: `webxr` in the page; `quick-look` on iPhones, with the model of `ios-src`. `scene-viewer` is known and never chosen: it reads no splats.
   * @default `webxr quick-look`
   * @example ar-modes="webxr"
   */
  arModes: text(),
  /**
   * Placement of an object in AR: on the `floor` or on a `wall`.
   * @default `floor`
   * @example ar-placement="wall"
   */
  arPlacement: text(),
  /**
   * `auto` shows an object of AR 0.5 to 1 m large at first, and two fingers scale it. `fixed` keeps its true size, which takes `unit`.
   * @default `auto`
   * @example ar-scale="fixed"
   */
  arScale: text(),
  /**
   * URL of a USDZ model for iPhones, which have no WebXR: a link says that it is a simplified model.
   * @default none
   * @example ios-src="vase.usdz"
   */
  iosSrc: text(),
  /**
   * URL of an equirectangular image (JPEG, PNG, WebP or AVIF) that surrounds the scene. Its middle lies at +x, as in `<model-viewer>`. It is in saved images and videos, and not in VR and AR.
   * @default none
   * @example skybox-image="meadow.jpg"
   */
  skyboxImage: text(),
  /**
   * Darkness of the shadow on the ground under the scene, 0 to 1. It is computed from the splats and meshes once, and
   * again when they change.
   * @default `0`: none. AR has one of `1`
   * @example shadow-intensity="1"
   */
  shadowIntensity: text<number | string | null>(),
  /**
   * How soft it is, 0 to 1.
   * @default `1`
   * @example shadow-softness="0.5"
   */
  shadowSoftness: text<number | string | null>(),
  /**
   * Gives visitors a ruler: a button, then two points by mouse, touch or keyboard. The event `measure` has the length.
   * @example measure
   */
  measure: flag(),
  /**
   * Turns the camera around the scene until a visitor touches it. It does not start for visitors who ask for less motion, nor while the scene has the
   * keyboard. A button stops it.
   * @example auto-rotate
   */
  autoRotate: flag(),
  /**
   * Milliseconds at rest before it turns.
   * @default `3000`
   * @example auto-rotate-delay="10000"
   */
  autoRotateDelay: number(milliseconds(3_000)),
  /**
   * How fast it turns.
   * @default `5.625deg`
   * @example rotation-per-second="30deg"
   */
  rotationPerSecond: read(angleGrammar('5.625deg')),
  /**
   * `auto` shows visitors who have not touched the scene that it can be rotated. `none` does not.
   * @default `auto`
   * @example interaction-prompt="none"
   */
  interactionPrompt: keyword<InteractionPrompt>(['auto', 'none']),
  /**
   * `basic` is a still image. `wiggle` swings the camera once, which draws frames.
   * @default `basic`
   * @example interaction-prompt-style="wiggle"
   */
  interactionPromptStyle: keyword<InteractionPromptStyle>(['basic', 'wiggle']),
  /**
   * Milliseconds without interaction before the prompt is shown.
   * @default `3000`
   * @example interaction-prompt-threshold="0"
   */
  interactionPromptThreshold: number(milliseconds(3_000)),
  /**
   * The words of the element in the language of the page: JSON or, as a property, an object. Keys: `front`, `upper-front`, `lower-front`, the same three
   * of `right`, `back` and `left`; `scene`, `role`, `interaction-prompt`, `keys-orbit`, `keys-fly`, `keys-walk`, `keys-views`; `views`, `next-view`, `previous-view`;
   * `vr`, `ar`, `exit-ar`, `ar-simplified`, `measure`, `measure-keys`, `measure-first`, `measure-none`;
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
   * builds none. Pixels such as `1px` allow this error in every frame. Streamed scenes (`detail.json`, `lod-meta.json`)
   * contain levels: `auto` is `1px` for them, and `off` loads a `lod-meta.json` completely at once.
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

type Table = typeof ATTRIBUTES;
/** The properties of all attributes. */
export type AttributeProperties = {
  -readonly [K in keyof Table]: Table[K] extends Attribute<infer P, unknown> ? P : never;
};

/** An attribute's raw value: text, or the value of the property. */
export type Raw = string | number | null | undefined;

/** All properties, as the page has set them. */
export type RawAttributes = { readonly [K in keyof Table]: unknown };

/** The parsed values: by their grammars, or the raw ones. */
export type Attributes = {
  readonly [K in keyof Table]: Table[K] extends Attribute<infer P, infer V> ? ([V] extends [never] ? P : V) : never;
} & { readonly camera: CameraSettings };

const entries = Object.entries(ATTRIBUTES) as [keyof Table, Attribute<unknown, unknown>][];
const attributeOf = (property: string): string => property.replace(/[A-Z]/g, (letter) => `-${letter.toLowerCase()}`);

/** Converts to Fetch's option. */
export const credentialsOf = (crossorigin: Attributes['crossorigin']): RequestCredentials =>
  crossorigin === 'use-credentials' ? 'include' : 'same-origin';

/** Returns the property declarations that Lit needs for a table of attributes, by default that of `<gaussian-splat>`. */
export const declarations = (
  table: Readonly<Record<string, Attribute<unknown, unknown>>> = ATTRIBUTES,
): PropertyDeclarations =>
  Object.fromEntries(Object.entries(table).map(([name, { lit }]) => [name, { ...lit, attribute: attributeOf(name) }]));

/** The boolean properties. */
export const flags = entries.filter(([, { lit }]) => lit.type === Boolean).map(([name]) => name);

/** Parses all attributes; `warn` is called with one sentence for each malformed one. */
export function readAttributes(raw: RawAttributes, warn: (sentence: string) => void): Attributes {
  const values = Object.fromEntries(
    entries.map(([name, { grammar }]) => [
      name,
      grammar ? readAttribute(attributeOf(name), raw[name] as Raw, grammar, warn) : raw[name],
    ]),
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
      orthographic: values.orthographic,
    },
  };
}
