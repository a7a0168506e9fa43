/** The check of words sees what it is for, and leaves code and other senses alone. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
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
