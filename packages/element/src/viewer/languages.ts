/** Texts of the element in the language of the page; loaded on demand unless it is English. */
import { LANGUAGES } from '../generated/languages.js';
import type { A11yStrings } from './strings.js';

/**
 * Returns the texts of a language; an empty object for English and languages without a translation.
 * @param lang value of the attribute `lang`: a BCP 47 tag such as `pt-BR`, whose region is ignored
 */
export async function wordsIn(lang: string): Promise<A11yStrings> {
  const [language] = lang.toLowerCase().split('-');
  return Object.hasOwn(LANGUAGES, language) ? (await LANGUAGES[language as keyof typeof LANGUAGES]()).words : {};
}
