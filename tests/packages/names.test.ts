/** The ESLint rule of retired names refuses declarations, and leaves references and keys of stored files alone. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Linter } from 'eslint';
import tseslint from 'typescript-eslint';
import { retiredNames } from '../../scripts/words/names.mjs';

function refused(source: string, filename = 'packages/core/src/a.ts'): string[] {
  const plugins = { words: { rules: { 'retired-names': retiredNames } } };
  const config = {
    files: ['**/*.ts'],
    plugins,
    rules: { 'words/retired-names': 'error' as const },
    languageOptions: { parser: tseslint.parser as Linter.Parser },
  };
  return new Linter()
    .verify(source, [config], filename)
    .map(({ message }) => /in "(\w+)"/.exec(message)?.[1] ?? message);
}

test('each kind of declaration is refused', () => {
  assert.deepEqual(refused('const told = 1, { a: spare, ...leavers } = b, [pace = 2] = c;'), [
    'told',
    'spare',
    'leavers',
    'pace',
  ]);
  assert.deepEqual(refused('function tellAll(wish) {} const f = (LEAST_SIZE) => 0;'), [
    'tellAll',
    'wish',
    'LEAST_SIZE',
  ]);
  assert.deepEqual(
    refused('class PictureFrame { #colour = 1; noted() {} constructor(private readonly lever: 1) {} }'),
    ['PictureFrame', 'colour', 'noted', 'lever'],
  );
  assert.deepEqual(refused('interface A { readonly centre: number; anew(): void } type Ladder = 1;'), [
    'centre',
    'anew',
    'Ladder',
  ]);
});

test('references, parts of other words and keys of contracts are accepted', () => {
  assert.deepEqual(refused('a.most = b.told; c({ spare: 1 });'), []);
  assert.deepEqual(refused('const space = 1, mostly = 2, atMost = 3, storytelling = 4;'), []);
  const contract = 'interface Instances { most: number }';
  assert.deepEqual(refused(contract, 'packages/core/src/contract/schema.ts'), []);
  assert.deepEqual(refused(contract), ['most']);
});
