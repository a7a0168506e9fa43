/**
 * `npm run lint:words [-- --longest 20] [--inside]`, a part of `npm run lint`: texts use the project's terms
 * (scripts/words/terms.mjs), and README and guides sentences of a readable length. It reads documents, pages of the site,
 * all comments, and all sentences in strings: errors, messages of commands, titles of tests. `--longest` prints the longest
 * sentences of README and guides, `--inside` prints the rates of comments and strings by kind.
 */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { root } from './lib/run.mjs';
import { RETIRED_PARTS, retiredPartOf } from './words/names.mjs';
import { blocksOfMarkdown, blocksOfPage, commentsInCode, sentencesOf, wordsOf } from './words/prose.mjs';
import { attributeComments, publicComments, sentencesInCode, sentencesInPython } from './words/sources.mjs';
import { RATES, retiredIn } from './words/terms.mjs';

/** Words of a sentence outside tables: bounds of the average, the longest, and the fractions above `many` and of at most `FEW` words. */
const LIMITS = {
  README: { files: (path) => path === 'README.md', min: 12, average: 16, longest: 30, short: 0.25 },
  guides: {
    files: (path) => path.startsWith('docs/guide/'),
    min: 12,
    average: 16,
    many: 30,
    fraction: 0.01,
    short: 0.25,
  },
};
const FEW = 7;
/** Upper limits per 1,000 words of documents and pages. */
const RATE_LIMITS = { where: 1.5, 'what-clauses': 1.5, 'of which': 0.5 };
/** Folders with code. Its comments keep upper limits of rates per 1,000 words, and have no retired words or fragments. */
const FOLDERS = ['packages', 'tests', 'scripts', 'demo', 'benchmarks', 'shaders'];
/** The retired words themselves, and their test. */
const EXEMPT = /^(scripts\/words\/|tests\/site\/words\.test\.ts$)/;
const COMMENTED_ENDINGS = ['.ts', '.tsx', '.mjs', '.js', '.wgsl', '.py'];
const COMMENT_LIMITS = { where: 3, 'what-clauses': 3, 'of which': 0.7 };
/** As in packages/exporter/pyproject.toml. */
const MAX_PYTHON_COLUMNS = 120;
const FRAGMENT = /^(What|Of|Where|With|By|That|Those)\b/;
const NOT_OURS = /(^|\/)(node_modules|dist|cdn|generated|\.[^/]+)$/;

const { values } = parseArgs({
  options: { longest: { type: 'string', default: '0' }, inside: { type: 'boolean', default: false } },
});
const documents = [
  'README.md',
  'CONTRIBUTING.md',
  'SECURITY.md',
  'CHANGELOG.md',
  ...filesIn('docs', '.md'),
  ...filesIn('packages', '.md'),
  ...filesIn('scripts', '.md'),
  ...filesIn('tests', '.md'),
];
const read = (path) => readFileSync(join(root, path), 'utf8');
const placed = (path, blocks) => blocks.map((block) => ({ file: path, ...block }));
const prose = new Map(documents.map((path) => [path, blocksOfMarkdown(read(path))]));

const documentsAndPages = [
  ...[...prose].flatMap(([path, blocks]) => placed(path, blocks)),
  ...filesIn('demo', '.md').flatMap((path) => placed(path, blocksOfMarkdown(read(path)))),
  ...[...filesIn('demo', '.njk'), ...filesIn('demo', '.html'), ...filesIn('benchmarks', '.html')].flatMap((path) =>
    placed(path, blocksOfPage(read(path))),
  ),
];
const code = FOLDERS.flatMap((folder) => COMMENTED_ENDINGS.flatMap((ending) => filesIn(folder, ending)))
  .concat(readdirSync(root).filter((name) => /\.(mjs|js)$/.test(name)))
  .filter((path) => !/generated/.test(path) && !EXEMPT.test(path));
const strings = code
  .filter((path) => !path.endsWith('.wgsl'))
  .flatMap((path) => (path.endsWith('.py') ? sentencesInPython : sentencesInCode)(join(root, path)));
const texts = [
  ...documentsAndPages,
  ...documents.flatMap((path) => placed(path, commentsInCode(read(path)))),
  ...strings,
  ...attributeComments(),
  ...publicComments(),
];

let faults = 0;
const seen = new Set();
for (const { file, line, text, isHeading } of texts) {
  for (const { found, instead, at } of retiredIn(text, { isHeading })) {
    const fault = `${file}:${line + text.slice(0, at).split('\n').length - 1}: "${found}". Write: ${instead}.`;
    if (seen.has(fault)) continue;
    seen.add(fault);
    faults++;
    console.error(`${fault}\n    … ${around(text, at, found.length)} …`);
  }
}
for (const [name, limit] of Object.entries(LIMITS)) faults += measure(name, limit);
faults += measureRates('documents', documentsAndPages, RATE_LIMITS);
faults += holdComments();
faults += holdShaderNames();
faults += holdPythonLines();
if (values.inside) countInside();
if (faults > 0) console.error(`\n${faults} to fix. The words: scripts/words/terms.mjs.`);
process.exit(faults > 0 ? 1 : 0);

/** Lines of Python that ruff refuses, which only `npm run test:exporter` runs. @returns {number} of them */
function holdPythonLines() {
  // Ruff does not count comments for tools.
  const columnsOf = (text) => [...text.replace(/\s*# (type|noqa).*$/, '')].length;
  const long = code
    .filter((path) => /^packages\/(exporter|notebook)\//.test(path) && path.endsWith('.py'))
    .flatMap((path) =>
      placed(
        path,
        [...read(path).split('\n').entries()].map(([i, text]) => ({ line: i + 1, text })),
      ),
    )
    .filter(({ text }) => columnsOf(text) > MAX_PYTHON_COLUMNS);
  for (const { file, line, text } of long)
    console.error(`${file}:${line}: expected at most ${MAX_PYTHON_COLUMNS} columns, found ${columnsOf(text)}`);
  return long.length;
}

/** Holds the sentences of some documents against their limits. @returns {number} of limits that are not kept */
function measure(name, { files, min, average, longest = Infinity, many = 30, fraction = 1, short }) {
  const sentences = [...prose]
    .filter(([path]) => files(path))
    .flatMap(([path, blocks]) =>
      blocks
        .filter(({ isHeading, isCell }) => !isHeading && !isCell)
        .flatMap(({ line, text }) =>
          sentencesOf(text).map((sentence) => ({ path, line, sentence, words: wordsOf(sentence) })),
        ),
    )
    // A label is no sentence.
    .filter(({ words }) => words >= 4)
    .sort((a, b) => b.words - a.words);
  const total = sentences.reduce((sum, { words }) => sum + words, 0);
  const mean = total / sentences.length;
  const few = sentences.filter(({ words }) => words <= FEW).length / sentences.length;
  const above = sentences.filter(({ words }) => words > many).length / sentences.length;
  console.log(
    `${name}: ${sentences.length} sentences of ${mean.toFixed(1)} words, the longest of ${sentences[0].words}, ${(100 * above).toFixed(1)} % above ${many}, ${(100 * few).toFixed(0)} % of ${FEW} or fewer`,
  );
  for (const { path, line, words, sentence } of sentences.slice(0, Number(values.longest)))
    console.log(`  ${words} ${path}:${line}: ${sentence}`);
  const broken = [
    mean > average && `expected ${average} words a sentence or fewer on average`,
    sentences[0].words > longest &&
      `expected no sentence above ${longest} words, found ${sentences[0].words} in line ${sentences[0].line}`,
    mean < min && `expected ${min} words a sentence or more on average`,
    few > short && `expected ${100 * short} % of the sentences with ${FEW} words or fewer, at most`,
    above > fraction && `expected ${100 * fraction} % of the sentences above ${many} words or fewer`,
  ].filter(Boolean);
  for (const sentence of broken) console.error(`${name}: ${sentence}. See -- --longest 20.`);
  return broken.length;
}

/** Rates of words per 1,000 words of some blocks. @returns {number} of limits that are exceeded */
function measureRates(name, blocks, limits = {}) {
  const total = blocks.reduce((sum, { text }) => sum + wordsOf(text), 0);
  const rates = Object.entries(RATES).map(([word, pattern]) => [
    word,
    (1000 * blocks.reduce((sum, { text }) => sum + (text.match(pattern)?.length ?? 0), 0)) / total,
  ]);
  console.log(`${name}: per 1,000 words ${rates.map(([word, rate]) => `${word} ${rate.toFixed(2)}`).join(', ')}`);
  const broken = rates.filter(([word, rate]) => rate > limits[word]);
  for (const [word, rate] of broken)
    console.error(
      `${name}: expected "${word}" ${limits[word]} times per 1,000 words at most, found ${rate.toFixed(2)}`,
    );
  return broken.length;
}

/** Checks all comments. @returns {number} of faults */
function holdComments() {
  const comments = code.flatMap((path) => commentsIn(read(path), path).map((text) => ({ path, text })));
  const wrong = comments.flatMap(({ path, text }) => [
    ...retiredIn(text).map(
      ({ found, instead, at }) =>
        `${path}: comment: "${found}". Write: ${instead}.\n    … ${around(text, at, found.length)} …`,
    ),
    ...(FRAGMENT.test(text)
      ? [`${path}: expected a comment that names its subject, found "${text.slice(0, 60)}"`]
      : []),
  ]);
  for (const sentence of wrong) console.error(sentence);
  console.log(`comments: ${comments.length}, ${wrong.length} retired words and fragments`);
  return wrong.length + measureRates('comments', comments, COMMENT_LIMITS);
}

/** Checks declared names of shaders, as the linter's rule does those of scripts. @returns {number} of faults */
function holdShaderNames() {
  const declaration =
    /(?:\b(?:fn|struct|alias|let|const|override|var(?:<[^>]*>)?)\s+|[(,{;]\s*|^\s+)(\w+)(?=\s*[:=({])/gm;
  const wrong = filesIn('shaders', '.wgsl').flatMap((path) =>
    [...read(path).matchAll(declaration)].flatMap(([, name]) => {
      const part = retiredPartOf(name, path);
      return part ? [`${path}: "${part}" in "${name}" is retired. Write: ${RETIRED_PARTS.get(part)}.`] : [];
    }),
  );
  for (const sentence of new Set(wrong)) console.error(sentence);
  return wrong.length;
}

/** Rates of comments and strings by kind, without limits. */
function countInside() {
  const ofProduct = (path) => /^(packages\/[^/]+\/src|shaders)\//.test(path);
  for (const [name, chosen] of Object.entries({
    'packages and shaders': ofProduct,
    'tests, scripts and pages': (path) => !ofProduct(path),
  })) {
    const comments = code.filter(chosen).flatMap((path) => commentsIn(read(path), path).map((text) => ({ text })));
    measureRates(`${comments.length} comments of ${name}`, comments);
    const sentences = strings.filter(({ file }) => chosen(file));
    measureRates(`${sentences.length} strings of ${name}`, sentences);
  }
}

/** Comments of three words or more, one text each; lines that follow each other are one comment. */
function commentsIn(source, path) {
  const pattern = path.endsWith('.py')
    ? /(?:^[ \t]*#[^\n]*\n)+|"""[\s\S]*?"""/gm
    : /\/\*[\s\S]*?\*\/|(?:^[ \t]*\/\/[^\n]*\n?)+|(?<=[;,{}()\]] )\/\/[^\n]*/gm;
  return [...source.matchAll(pattern)]
    .map(([text]) =>
      text
        .replace(/^[ \t]*(\/\*\*?|\*\/|\*|\/\/|#|""")|\*\/$|"""$/gm, '')
        .replace(/`[^`]*`/g, '`')
        // Parameters have the names of the code.
        .replace(/@param \w+/g, '@param')
        .trim(),
    )
    .filter((text) => wordsOf(text) >= 3 && !/^(eslint|oxlint|@ts|prettier)/.test(text));
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
