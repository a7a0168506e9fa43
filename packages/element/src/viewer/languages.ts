/** Texts of the element in the language of the page; loaded on demand unless it is English. */
import type { A11yStrings, Words } from './strings.js';

const LANGUAGES: Readonly<Record<string, () => Promise<{ readonly words: Words }>>> = {
  de: () => import('../languages/de.js'),
  es: () => import('../languages/es.js'),
  fr: () => import('../languages/fr.js'),
  ja: () => import('../languages/ja.js'),
  ko: () => import('../languages/ko.js'),
  pt: () => import('../languages/pt.js'),
  ru: () => import('../languages/ru.js'),
  zh: () => import('../languages/zh.js'),
};

/**
 * Returns the texts of a language; an empty object for English and languages without a translation.
 * @param lang value of the attribute `lang`: a BCP 47 tag such as `pt-BR`, whose region is ignored
 */
export async function wordsIn(lang: string): Promise<A11yStrings> {
  const [language] = lang.toLowerCase().split('-');
  return Object.hasOwn(LANGUAGES, language) ? (await LANGUAGES[language]()).words : {};
}
