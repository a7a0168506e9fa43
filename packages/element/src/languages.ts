/** The words of the element in the languages of pages: fetched where that is not English. */
import type { A11yStrings, Words } from './words.js';

const LANGUAGES: Readonly<Record<string, () => Promise<{ readonly words: Words }>>> = {
  de: () => import('./languages/de.js'),
  es: () => import('./languages/es.js'),
  fr: () => import('./languages/fr.js'),
  ja: () => import('./languages/ja.js'),
  ko: () => import('./languages/ko.js'),
  pt: () => import('./languages/pt.js'),
  ru: () => import('./languages/ru.js'),
  zh: () => import('./languages/zh.js'),
};

/**
 * The words of a language.
 * @param lang as of the attribute `lang`: a tag of BCP 47 such as `pt-BR`, of which the language counts
 * @returns none for a language that the element does not speak
 */
export async function wordsIn(lang: string): Promise<A11yStrings> {
  const [language] = lang.toLowerCase().split('-');
  return Object.hasOwn(LANGUAGES, language) ? (await LANGUAGES[language]()).words : {};
}
