/** Texts of the element for visitors, and texts of the page that replace them. */
import type { WordKey } from '../generated/languages.js';

/**
 * English texts of the base code. In `show`, `…` is replaced by the text alternative of the scene. The keys are also
 * those of the attribute `a11y`.
 */
export const WORDS = {
  scene: '3D scene',
  role: '3D scene viewer',
  show: 'Show …',
  loading: 'Loading the 3D scene',
  details: 'Details',
} as const;

/**
 * All texts of the element in one language. The key `error-…` has the sentence for visitors for an
 * `element.error.code`. English texts are with the code that uses them; `languages/*.json` have the other languages.
 */
export type Words = Readonly<Record<WordKey, string>>;

/** Texts of the page, or in the language of the page, that replace English texts. */
export type A11yStrings = Partial<Words>;

/** Returns the text of the page for a key, or else the English text. */
export const word = (strings: A11yStrings, key: keyof typeof WORDS): string => strings[key] ?? WORDS[key];

/**
 * Returns the value of `lang` for a text of the element: `en` without {@link A11yStrings}, else undefined, because
 * those are in the language of the page.
 */
export const languageOf = (strings: A11yStrings): 'en' | undefined =>
  Object.keys(strings).length === 0 ? 'en' : undefined;

/**
 * Parses the attribute `a11y`: an object, or its JSON. Keys whose value is not a string are ignored.
 * @returns an empty object for no value; null for a malformed one
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
