/** The check of words finds retired words, and ignores code and other senses. */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { blocksOfMarkdown, blocksOfPage, sentencesOf, wordsOf } from '../../scripts/words/prose.mjs';
import { retiredIn } from '../../scripts/words/terms.mjs';

const found = (text: string): string[] => retiredIn(text).map((hit) => hit.found);

test('retired words are found in their retired sense alone', () => {
  assert.deepEqual(found('The true image is on show, as nobody told the lever.'), [
    'true image',
    'on show',
    'nobody',
    'told',
    'lever',
  ]);
  assert.deepEqual(found('It is true that a level may leave a thin box, and that you look at it.'), []);
});

test('Markdown: code and addresses are no prose, cells and items are', () => {
  const blocks = blocksOfMarkdown(
    '# A picture\n\nSee `picture` and\n[the page](picture.md).\n\n```js\nconst picture = 1;\n```\n\n| a | picture |\n|---|---|\n\n- one\n- two pictures\n',
  );
  assert.deepEqual(
    blocks.map(({ line, text }) => [line, text]),
    [
      [1, 'A picture'],
      [3, 'See ` and\nthe page.'],
      [10, 'a'],
      [10, 'picture'],
      [13, 'one'],
      [14, 'two pictures'],
    ],
  );
});

test('pages: what is shown and what is read aloud, without scripts', () => {
  const blocks = blocksOfPage(
    '---\ntitle: A picture\n---\n<p>Turn {{ x }} <b>it</b>.</p>\n<script>const picture = 1;</script>\n<img alt="a picture" />',
  );
  assert.deepEqual(
    blocks.map(({ line, text }) => [line, text]),
    [
      [2, 'A picture'],
      [6, 'a picture'],
      [4, 'Turn ` it.'],
    ],
  );
});

test('a sentence ends at its stop, not at a colon, and code is one word', () => {
  const sentences = sentencesOf('Write ` here: it counts. Then stop! (So it is.) 3 words follow.');
  assert.deepEqual(sentences.map(wordsOf), [5, 2, 3, 3]);
});

const root = fileURLToPath(new URL('../../', import.meta.url));

function sources(folder: string): string[] {
  return readdirSync(join(root, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = `${folder}/${entry.name}`;
    if (entry.isDirectory()) return /^(node_modules|dist|cdn|generated)$/.test(entry.name) ? [] : sources(path);
    return /\.(ts|mjs|py)$/.test(entry.name) ? [path] : [];
  });
}

test('documents and sections that errors and comments of the packages name exist', () => {
  const missing: string[] = [];
  let count = 0;
  for (const path of sources('packages')) {
    const source = readFileSync(join(root, path), 'utf8');
    for (const { 1: section, 2: document } of source.matchAll(
      /(?:"([^"\n]+)" in (?:the )?)?((?:docs\/[\w/-]+|\bpackages\/[\w/-]+\/README)\.md)/g,
    )) {
      count++;
      const file = join(root, document);
      if (!existsSync(file)) missing.push(`${path}: ${document}`);
      else if (section && !new RegExp(`^#+ ${section}$`, 'm').test(readFileSync(file, 'utf8')))
        missing.push(`${path}: "${section}" in ${document}`);
    }
    if (/README of the /.test(source)) missing.push(`${path}: a README without a path`);
  }
  assert.ok(count > 10, `${count} mentions`);
  assert.deepEqual(missing, []);
});
