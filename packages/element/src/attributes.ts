/** Attributes of `<gaussian-splat>` that carry more than a word: their grammars and defaults, in one place. */
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
import { QUALITIES, type Quality } from '@gaussian-splat/renderer';
import type { ShDegree } from '@gaussian-splat/core';
import { timerMs } from './timer-ms.js';
import type { CameraSettings } from './camera/settings.js';

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

/** When the poster gives way: as soon as the scene can be drawn, or when the page says so. */
export type Reveal = 'auto' | 'manual';

/** Whether people are shown how to move the camera. */
export type InteractionPrompt = 'auto' | 'none';

/** `wiggle` turns the camera to and fro with the prompt; `basic` stands still. */
export type InteractionPromptStyle = 'wiggle' | 'basic';

/** What the camera does under a person's hands: turn around its target, or fly. */
export type Navigation = 'orbit' | 'fly';

/** An attribute's raw value: text, or what a property was given instead. */
export type Raw = string | number | null | undefined;

/** The properties read here, by their attributes' camel-case names. */
export interface RawAttributes {
  readonly crossorigin: Raw;
  readonly loading: Raw;
  readonly cameraOrbit: Raw;
  readonly cameraTarget: Raw;
  readonly fieldOfView: Raw;
  readonly minCameraOrbit: Raw;
  readonly maxCameraOrbit: Raw;
  readonly minFieldOfView: Raw;
  readonly maxFieldOfView: Raw;
  readonly interpolationDecay: Raw;
  readonly touchAction: Raw;
  readonly up: Raw;
  readonly maxPixelRatio: Raw;
  readonly frameBudget: Raw;
  readonly quality: Raw;
  readonly maxShDegree: Raw;
  readonly detail: Raw;
  readonly reveal: Raw;
  readonly navigation: Raw;
  readonly autoRotateDelay: Raw;
  readonly rotationPerSecond: Raw;
  readonly interactionPrompt: Raw;
  readonly interactionPromptStyle: Raw;
  readonly interactionPromptThreshold: Raw;
}

/** All of them, read. */
export interface Attributes {
  readonly credentials: RequestCredentials;
  readonly loading: Loading;
  readonly camera: CameraSettings;
  /** Time constant of the camera's motion, ms. */
  readonly interpolationDecay: number;
  readonly touchAction: TouchAction;
  /** Most drawn pixels for one CSS pixel. */
  readonly maxPixelRatio: number;
  /** Most that a picture in motion may take on the GPU, ms; infinite where the display says. */
  readonly frameBudget: number;
  /** The renderer's mix of accuracy and speed. */
  readonly quality: QualityChoice;
  /** Spherical harmonics above this degree are not evaluated. */
  readonly maxShDegree: ShDegree;
  readonly detail: DetailChoice;
  readonly reveal: Reveal;
  readonly navigation: Navigation;
  /** Rest before the camera turns by itself, ms. */
  readonly autoRotateDelay: number;
  /** Radians. */
  readonly rotationPerSecond: number;
  readonly interactionPrompt: InteractionPrompt;
  readonly interactionPromptStyle: InteractionPromptStyle;
  /** Rest before the prompt is shown, ms. */
  readonly interactionPromptThreshold: number;
}

const orbit = orbitGrammar('0deg 75deg auto');
const orbitLimit = orbitGrammar('auto');
const crossorigin = keywordGrammar(['anonymous', 'use-credentials']);
const loading = keywordGrammar<Loading>(['lazy', 'eager']);
const touchAction = keywordGrammar<TouchAction>(['pan-y', 'pan-x', 'none', 'auto', 'manipulation']);
const quality = keywordGrammar<QualityChoice>(['auto', ...(Object.keys(QUALITIES) as Quality[])]);
const maxShDegree = keywordGrammar(['3', '2', '1', '0']);
/** The renderer's own limit. */
const MOST_DETAIL_PIXELS = 64;
const detail: AttributeGrammar<DetailChoice> = {
  expected: `auto, off, or at most ${MOST_DETAIL_PIXELS} pixels such as 1px`,
  fallback: 'auto',
  parse: (text) => {
    const word = text.trim().toLowerCase();
    if (word === 'auto' || word === 'off') return word;
    const pixels = /^(\d+\.?\d*|\.\d+)px$/.test(word) ? parseFloat(word) : NaN;
    return pixels <= MOST_DETAIL_PIXELS ? pixels : null;
  },
};
const reveal = keywordGrammar<Reveal>(['auto', 'manual']);
const navigation = keywordGrammar<Navigation>(['orbit', 'fly']);
const interactionPrompt = keywordGrammar<InteractionPrompt>(['auto', 'none']);
const interactionPromptStyle = keywordGrammar<InteractionPromptStyle>(['basic', 'wiggle']);
const milliseconds = (fallback: number): AttributeGrammar<number> => {
  const grammar = numberGrammar(fallback, 0, 'milliseconds, 0 or more');
  return {
    ...grammar,
    parse: (text) => {
      const value = grammar.parse(text);
      return value === null ? null : timerMs(value);
    },
  };
};
const interpolationDecay = milliseconds(50);
const threeSeconds = milliseconds(3_000);
const rotationPerSecond = angleGrammar('5.625deg');
// Far below any ratio in use, so that 0 is refused but thumbnails of pixels are not.
const maxPixelRatio = numberGrammar(Infinity, 1 / 64, 'drawn pixels for each CSS pixel, above 0');
const frameBudget = numberGrammar(Infinity, 0.01, 'milliseconds, 0.01 or more');

/** Reads all attributes; `warn` gets one sentence for each malformed one. */
export function readAttributes(raw: RawAttributes, warn: (sentence: string) => void): Attributes {
  const read = <T>(name: string, text: Raw, grammar: AttributeGrammar<T>): T =>
    readAttribute(name, text, grammar, warn);
  return {
    credentials: read('crossorigin', raw.crossorigin, crossorigin) === 'use-credentials' ? 'include' : 'same-origin',
    loading: read('loading', raw.loading, loading),
    interpolationDecay: read('interpolation-decay', raw.interpolationDecay, interpolationDecay),
    touchAction: read('touch-action', raw.touchAction, touchAction),
    maxPixelRatio: read('max-pixel-ratio', raw.maxPixelRatio, maxPixelRatio),
    frameBudget: read('frame-budget', raw.frameBudget, frameBudget),
    quality: read('quality', raw.quality, quality),
    maxShDegree: Number(read('max-sh-degree', raw.maxShDegree, maxShDegree)) as ShDegree,
    detail: read('detail', raw.detail, detail),
    reveal: read('reveal', raw.reveal, reveal),
    navigation: read('navigation', raw.navigation, navigation),
    autoRotateDelay: read('auto-rotate-delay', raw.autoRotateDelay, threeSeconds),
    rotationPerSecond: read('rotation-per-second', raw.rotationPerSecond, rotationPerSecond),
    interactionPrompt: read('interaction-prompt', raw.interactionPrompt, interactionPrompt),
    interactionPromptStyle: read('interaction-prompt-style', raw.interactionPromptStyle, interactionPromptStyle),
    interactionPromptThreshold: read('interaction-prompt-threshold', raw.interactionPromptThreshold, threeSeconds),
    camera: {
      orbit: read('camera-orbit', raw.cameraOrbit, orbit),
      target: read('camera-target', raw.cameraTarget, targetGrammar),
      fieldOfView: read('field-of-view', raw.fieldOfView, fieldOfViewGrammar),
      minOrbit: read('min-camera-orbit', raw.minCameraOrbit, orbitLimit),
      maxOrbit: read('max-camera-orbit', raw.maxCameraOrbit, orbitLimit),
      minFieldOfView: read('min-field-of-view', raw.minFieldOfView, fieldOfViewGrammar),
      maxFieldOfView: read('max-field-of-view', raw.maxFieldOfView, fieldOfViewGrammar),
      up: read('up', raw.up, upGrammar),
    },
  };
}
