/**
 * `npm run lint:words [-- --longest 20]`, a part of `npm run lint`: what is written for readers keeps to the project's words (scripts/words/terms.mjs), and README and guides to short sentences. Read are documents, pages of the
 * site, comments of the public API, the tables of attributes, and sentences of errors and of scripts. `--longest` prints the longest sentences of README and guides.
 */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { root } from './lib/run.mjs';
import { blocksOfMarkdown, blocksOfPage, sentencesOf, wordsOf } from './words/prose.mjs';
import { attributeComments, publicComments, sentencesInCode } from './words/sources.mjs';
import { retiredIn } from './words/terms.mjs';

/** Words a sentence: on average, most, and the share above `many`. */
const LIMITS = {
  README: { files: (path) => path === 'README.md', average: 16, longest: 35 },
  guides: { files: (path) => path.startsWith('docs/guide/'), average: 17, many: 30, share: 0.03 },
};
/** Written by a command, from the headers of tests. */
const GENERATED = ['docs/stability.md'];
/** Reasons and records, for those who work on the project. */
const RECORDS = /^docs\/decisions\//;
const NOT_OURS = /(^|\/)(node_modules|dist|cdn|generated|\.[^/]+)$/;

const { values } = parseArgs({ options: { longest: { type: 'string', default: '0' } } });
const documents = [
  'README.md',
  'CONTRIBUTING.md',
  'SECURITY.md',
  'CHANGELOG.md',
  ...filesIn('docs', '.md'),
  ...filesIn('packages', '.md'),
].filter((path) => !GENERATED.includes(path) && !RECORDS.test(path));
const read = (path) => readFileSync(join(root, path), 'utf8');
const placed = (path, blocks) => blocks.map((block) => ({ file: path, ...block }));
const prose = new Map(documents.map((path) => [path, blocksOfMarkdown(read(path))]));

const texts = [
  ...[...prose].flatMap(([path, blocks]) => placed(path, blocks)),
  ...filesIn('demo', '.md').flatMap((path) => placed(path, blocksOfMarkdown(read(path)))),
  ...[...filesIn('demo', '.njk'), ...filesIn('demo', '.html'), ...filesIn('benchmarks', '.html')].flatMap((path) =>
    placed(path, blocksOfPage(read(path))),
  ),
  ...[
    ...filesIn('demo', '.js'),
    ...filesIn('benchmarks', '.js'),
    ...filesIn('demo', '.tsx'),
    ...filesIn('packages', '.ts').filter((path) => path.includes('/src/')),
  ].flatMap((path) => sentencesInCode(join(root, path))),
  ...attributeComments(),
  ...publicComments(),
];

let faults = 0;
const seen = new Set();
for (const { file, line, text } of texts) {
  for (const { found, instead, at } of retiredIn(text)) {
    const fault = `${file}:${line + text.slice(0, at).split('\n').length - 1}: "${found}". Write: ${instead}.`;
    if (seen.has(fault)) continue;
    seen.add(fault);
    faults++;
    console.error(`${fault}\n    … ${around(text, at, found.length)} …`);
  }
}
for (const [name, limit] of Object.entries(LIMITS)) faults += measure(name, limit);
if (faults > 0) console.error(`\n${faults} to mend. The words: scripts/words/terms.mjs.`);
process.exit(faults > 0 ? 1 : 0);

/** Holds the sentences of some documents against their limits. @returns {number} of limits that are not kept */
function measure(name, { files, average, longest = Infinity, many = 30, share = 1 }) {
  const sentences = [...prose]
    .filter(([path]) => files(path))
    .flatMap(([path, blocks]) =>
      blocks
        .filter(({ isHeading }) => !isHeading)
        .flatMap(({ line, text }) =>
          sentencesOf(text).map((sentence) => ({ path, line, sentence, words: wordsOf(sentence) })),
        ),
    )
    // A name or a number in a cell is no sentence.
    .filter(({ words }) => words >= 4)
    .sort((a, b) => b.words - a.words);
  const total = sentences.reduce((sum, { words }) => sum + words, 0);
  const mean = total / sentences.length;
  const above = sentences.filter(({ words }) => words > many).length / sentences.length;
  console.log(
    `${name}: ${sentences.length} sentences of ${mean.toFixed(1)} words, the longest of ${sentences[0].words}, ${(100 * above).toFixed(1)} % above ${many}`,
  );
  for (const { path, line, words, sentence } of sentences.slice(0, Number(values.longest)))
    console.log(`  ${words} ${path}:${line}: ${sentence}`);
  const broken = [
    mean > average && `expected ${average} words a sentence or fewer on average`,
    sentences[0].words > longest &&
      `expected no sentence above ${longest} words, found ${sentences[0].words} in line ${sentences[0].line}`,
    above > share && `expected ${100 * share} % of the sentences above ${many} words or fewer`,
  ].filter(Boolean);
  for (const sentence of broken) console.error(`${name}: ${sentence}. See -- --longest 20.`);
  return broken.length;
}

function filesIn(folder, ending) {
  return readdirSync(join(root, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = `${folder}/${entry.name}`;
    if (entry.isDirectory()) return NOT_OURS.test(path) ? [] : filesIn(path, ending);
    return entry.name.endsWith(ending) && !entry.name.endsWith('.d.ts') ? [path] : [];
  });
}

function around(text, at, length) {
  return text.slice(Math.max(0, at - 50), at + length + 50).replace(/\s+/g, ' ');
}
