/** The words of the element in nine languages. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { wordsIn } from '../../packages/element/dist/viewer/languages.js';

const LANGUAGES = ['de', 'es', 'fr', 'ja', 'ko', 'pt', 'ru', 'zh'];

test('each language has all words, and none of another', async () => {
  const all = await Promise.all(LANGUAGES.map((language) => wordsIn(language)));
  const keys = Object.keys(all[0]).sort();
  assert.ok(keys.length >= 47, `${keys.length} words`);
  for (const [i, words] of all.entries()) {
    assert.deepEqual(Object.keys(words).sort(), keys, LANGUAGES[i]);
    for (const [key, text] of Object.entries(words)) {
      assert.ok(text.trim().length > 0, `${LANGUAGES[i]}: ${key}`);
      // `…` stands for the name of the scene.
      assert.equal(text.includes('…'), key === 'show', `${LANGUAGES[i]}: ${key}`);
    }
    for (const [j, others] of all.entries())
      if (j !== i) assert.notEqual(words['keys-orbit'], others['keys-orbit'], `${LANGUAGES[i]} and ${LANGUAGES[j]}`);
  }
});

test('a tag counts by its language, and others have no words', async () => {
  assert.deepEqual(await wordsIn('pt-BR'), await wordsIn('pt'));
  assert.deepEqual(await wordsIn('ZH-Hant'), await wordsIn('zh'));
  for (const tag of ['en', 'sv', '', 'constructor', 'x']) assert.deepEqual(await wordsIn(tag), {}, tag);
});
