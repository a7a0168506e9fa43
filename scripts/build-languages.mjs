/** Turns packages/element/languages/*.json, the words of the element, into a module for each language and their table. */
import { mkdirSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const path = (name) => fileURLToPath(new URL(`../packages/element/${name}`, import.meta.url));
const header = '/** Written by scripts/build-languages.mjs from languages/. Do not edit. */\n/* eslint-disable */\n';
const languages = readdirSync(path('languages')).map((file) => file.replace('.json', ''));
const wordsOf = (language) => JSON.parse(readFileSync(path(`languages/${language}.json`), 'utf8'));

mkdirSync(path('src/generated'), { recursive: true });
for (const language of languages) {
  const code = `export const words = ${JSON.stringify(wordsOf(language), null, 2)} as const;\n`;
  writeFileSync(path(`src/generated/words-${language}.ts`), header + code);
}
const keys = Object.keys(wordsOf(languages[0])).map((key) => `  | ${JSON.stringify(key)}`);
const rows = languages.map((language) => `  ${language}: () => import('./words-${language}.js'),`);
writeFileSync(
  path('src/generated/languages.ts'),
  `${header}export type WordKey =\n${keys.join('\n')};\n\nexport const LANGUAGES = {\n${rows.join('\n')}\n};\n`,
);
