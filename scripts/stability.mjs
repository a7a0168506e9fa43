/**
 * `npm run stability`: every row of the catalogue at full length, in Node and in Chromium. `-- PATTERN` runs the rows whose file name contains it;
 * `-- --report` also writes docs/stability.md, its charts and the demo's copies; `-- --peers` puts the peers through the rows that a page can.
 */
import { existsSync, mkdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { ensureChromium } from './lib/chromium.mjs';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { root, run } from './lib/run.mjs';

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    report: { type: 'boolean', default: false },
    peers: { type: 'boolean', default: false },
    /** The short recipes of `npm test`. */
    fast: { type: 'boolean', default: false },
    /** Writes the report from the figures of the last run. */
    only: { type: 'boolean', default: false },
  },
});

ensureDependencies();
ensureBuilt();
process.env.CHROMIUM = ensureChromium();
const cache = join(root, '.cache/stability');
mkdirSync(cache, { recursive: true });
const figures = join(cache, 'figures.jsonl');
const peers = join(cache, 'peers.json');
seedFromReport();

let status = 0;
if (!values.only) status = runRows() | runBrowserRows();
if (values.peers) status |= run(process.execPath, ['scripts/stability/run-peers.mjs', peers]);
if (values.report) {
  const { writeReport } = await import('./stability/report.mjs');
  writeReport({
    lines: readLines(figures),
    peers: existsSync(peers) ? JSON.parse(readFileSync(peers, 'utf8')) : undefined,
  });
}
process.exit(status);

function runRows() {
  const fresh = join(cache, 'figures-new.jsonl');
  rmSync(fresh, { force: true });
  const env = {
    ...gpuEnvironment(),
    STABILITY: values.fast ? 'fast' : 'full',
    STABILITY_FIGURES: fresh,
    STABILITY_ROWS: positionals[0] ?? '',
  };
  const args = ['--import', 'tsx', '--test', '--test-reporter', 'spec', 'tests/stability/catalogue.test.ts'];
  const status = run(process.execPath, args, { env });
  // Rows that were not run keep the figures of their last run.
  const lines = readLines(fresh);
  const rows = new Set(lines.map(({ row }) => row));
  const kept = readLines(figures).filter(({ row }) => !rows.has(row));
  writeLines(figures, [...kept, ...lines]);
  return status;
}

/** What a fresh copy knows of rows that it has not run is what the published report says of them. */
function seedFromReport() {
  const published = join(root, 'docs/stability/figures.json');
  if (existsSync(figures) || !existsSync(published)) return;
  const report = JSON.parse(readFileSync(published, 'utf8'));
  writeLines(figures, [...report.rows.flatMap((row) => row.figures), ...report.curves]);
  if (report.peers) writeFileSync(peers, JSON.stringify(report.peers));
}

function writeLines(file, lines) {
  writeFileSync(file, lines.map((line) => `${JSON.stringify(line)}\n`).join(''));
}

function readLines(file) {
  if (!existsSync(file)) return [];
  const lines = readFileSync(file, 'utf8').split('\n').filter(Boolean);
  return lines.map((line) => JSON.parse(line));
}

function runBrowserRows() {
  if (positionals.length > 0) return 0;
  const runner = 'node_modules/@web/test-runner/dist/bin.js';
  const env = { STABILITY: values.fast ? 'fast' : 'full', NODE_ENV: 'test' };
  const config = ['--config', 'web-test-runner.config.mjs', '--files', 'tests/stability/browser/**/*.test.ts'];
  return run(process.execPath, [runner, ...config], { env });
}
