/**
 * `npm run lab -- stability`: every row of the catalog at full length, each in a process of its own, in Node and in Chromium. `-- PATTERN` runs the rows whose file name contains it;
 * `-- --peers` puts the peers through the rows that a page can run; `-- --report` also writes docs/stability.md, its charts and figures.json, which the demo reads;
 * `-- --merge FILE...` runs nothing and adds measurements of another machine: its .cache/stability/runs.jsonl, or reports that the page POSTed.
 */
import { appendFileSync, existsSync, mkdirSync, statSync } from 'node:fs';
import { basename, join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { ensureChromium, findSwiftShader } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { root, run } from './lib/run.mjs';
import { readFiles } from './stability/figures.mjs';
import { rowFiles } from './stability/headers.mjs';
import { writeReport } from './stability/report.mjs';

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    report: { type: 'boolean', default: false },
    peers: { type: 'boolean', default: false },
    /** The short recipes of `npm test`. */
    fast: { type: 'boolean', default: false },
    /** Writes the report from the figures of the last runs. */
    only: { type: 'boolean', default: false },
    /** Positional arguments are files of figures. */
    merge: { type: 'boolean', default: false },
  },
});

/** Folder that a person's relative paths start from: npm itself runs scripts in the project's root. */
const from = process.env.INIT_CWD ?? process.cwd();
const cache = join(root, '.cache/stability');
/** Measurements on this machine: lines are only ever added, and the latest of a row counts. */
const figures = join(cache, 'runs.jsonl');
const peers = join(cache, 'peers.json');

process.exit(values.merge ? merge() : measure());

function merge() {
  if (positionals.length === 0) throw new Error('--merge: expected files of figures, found none');
  writeReport(readFiles(positionals.map((path) => resolve(from, path))));
  return 0;
}

function measure() {
  ensureDependencies();
  ensureBuilt();
  mkdirSync(cache, { recursive: true });
  const needsChromium = values.peers || (!values.only && positionals.length === 0);
  const needsSwiftShader = process.platform === 'linux' && process.env.GAUSSIAN_SPLAT_GPU !== 'system';
  if (needsChromium || (needsSwiftShader && !findSwiftShader())) process.env.CHROMIUM = ensureChromium();
  let status = 0;
  if (!values.only) status = runRows() | runBrowserRows();
  if (values.peers) status |= run(process.execPath, ['scripts/stability/run-peers.mjs', peers]);
  if (values.report) writeReport(readFiles([figures, peers].filter(existsSync)));
  else console.log(`Figures of this machine: ${figures}. Published are those that --report or --merge has taken up.`);
  return status;
}

/** Figures of a row that fails are kept, and that it failed. */
function runRows() {
  const chosen = rowFiles().filter(({ file }) => basename(file).includes(positionals[0] ?? ''));
  const failed = chosen.filter(({ file, id }) => {
    const before = sizeOf(figures);
    const passed = runRow(basename(file)) === 0;
    // Nothing was recorded if no adapter was found.
    if (id !== undefined && sizeOf(figures) > before) {
      appendFileSync(figures, `${JSON.stringify({ row: id, passed })}\n`);
    }
    return !passed;
  });
  console.log(`${chosen.length - failed.length} of ${chosen.length} files pass`);
  for (const { file } of failed) console.log(`  failed: ${file}`);
  return failed.length === 0 ? 0 : 1;
}

function sizeOf(file) {
  return existsSync(file) ? statSync(file).size : 0;
}

function runRow(name) {
  const env = {
    ...gpuEnvironment(),
    STABILITY: values.fast ? 'fast' : 'full',
    STABILITY_FIGURES: figures,
    STABILITY_ROWS: name,
  };
  const args = ['--import', 'tsx', '--test', '--test-reporter', 'spec', 'tests/stability/catalog.alone.lab.test.ts'];
  return run(process.execPath, args, { env });
}

function runBrowserRows() {
  if (positionals.length > 0) return 0;
  const runner = 'node_modules/@web/test-runner/dist/bin.js';
  const env = { STABILITY: values.fast ? 'fast' : 'full', NODE_ENV: 'test' };
  const config = ['--config', 'web-test-runner.config.mjs', '--files', 'tests/stability/browser/**/*.test.ts'];
  return run(process.execPath, [runner, ...config], { env });
}
