/** The words that the element says to people, and those that a page may put in their place. */
import type { ViewName } from './camera/spoken.js';
import type { ElementErrorCode } from './errors.js';
import type { PANEL_WORDS } from './dynamic/controls-panel.js';

/**
 * Texts of the element except those for the camera's position, in English; `…` stands for the scene's text alternative.
 * The keys are those of `a11y`, too.
 */
export const WORDS = {
  scene: '3D scene',
  role: '3D scene viewer',
  show: 'Show …',
  loading: 'Loading the 3D scene',
  details: 'Details',
} as const;

/** Words of the bar of the views, which few pages have. */
export type ViewString = 'views' | 'next-view' | 'previous-view' | 'keys-views';

/** Words of walking, which few pages have. */
export type WalkWord = 'keys-walk' | 'blocked';

/** Texts for visitors who may move the camera; loaded with the input code. */
export type HandWord = 'keys-orbit' | 'keys-fly' | 'interaction-prompt' | 'reset';

/** Texts of the button that pauses automatic motion; loaded with its code. */
export type MotionWord = 'pause' | 'play';

/** Words of VR, AR and measuring, which few pages have. */
export type ExtraWord = 'vr' | 'ar' | 'exit-ar' | 'ar-simplified' | 'measure' | 'measure-keys' | 'measure-none';

/** All words of the element in one language; those for errors are sentences for visitors, by `element.error.code`. */
export type Words = Readonly<
  Record<
    | ViewName
    | keyof typeof WORDS
    | keyof typeof PANEL_WORDS
    | `error-${ElementErrorCode}`
    | ViewString
    | WalkWord
    | HandWord
    | MotionWord
    | ExtraWord,
    string
  >
>;

/** Strings of a page, or of its language, in place of the English ones. */
export type A11yStrings = Partial<Words>;

/** A word of the page, or the English one. */
export const word = (strings: A11yStrings, key: keyof typeof WORDS): string => strings[key] ?? WORDS[key];

/** The language of the element's own words: those of a page, and of {@link Words}, are in the language of the page. */
export const languageOf = (strings: A11yStrings): 'en' | undefined =>
  Object.keys(strings).length === 0 ? 'en' : undefined;

/**
 * The attribute `a11y`: an object, or its JSON.
 * @returns null if it is malformed
 */
export function readSpokenStrings(value: unknown): A11yStrings | null {
  if (value === null || value === undefined || value === '') return {};
  let parsed: unknown = value;
  if (typeof value === 'string') {
    try {
      parsed = JSON.parse(value);
    } catch {
      return null;
    }
  }
  const isObject = typeof parsed === 'object' && parsed !== null && !Array.isArray(parsed);
  if (!isObject) return null;
  const strings = Object.entries(parsed as object).filter(([, text]) => typeof text === 'string');
  return Object.fromEntries(strings) as A11yStrings;
}
