/**
 * `npm run stability`: every row of the catalogue at full length, in Node and in Chromium. `-- PATTERN` runs the rows whose file name contains it;
 * `-- --report` also writes docs/stability.md, its charts and the demo's copies; `-- --peers` puts the peers through the rows that a page can.
 */
import { existsSync, mkdirSync, readFileSync, rmSync } from 'node:fs';
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

let status = 0;
if (!values.only) status = runRows() | runBrowserRows();
if (values.peers) status |= run(process.execPath, ['scripts/stability/run-peers.mjs', join(cache, 'peers.json')]);
if (values.report) {
  const { writeReport } = await import('./stability/report.mjs');
  const peers = join(cache, 'peers.json');
  writeReport({
    lines: readFileSync(figures, 'utf8')
      .trim()
      .split('\n')
      .map((line) => JSON.parse(line)),
    peers: existsSync(peers) ? JSON.parse(readFileSync(peers, 'utf8')) : undefined,
  });
}
process.exit(status);

function runRows() {
  rmSync(figures, { force: true });
  const env = {
    ...gpuEnvironment(),
    STABILITY: values.fast ? 'fast' : 'full',
    STABILITY_FIGURES: figures,
    STABILITY_ROWS: positionals[0] ?? '',
  };
  const args = ['--import', 'tsx', '--test', '--test-reporter', 'spec', 'tests/stability/catalogue.test.ts'];
  return run(process.execPath, args, { env });
}

function runBrowserRows() {
  if (positionals.length > 0) return 0;
  const runner = 'node_modules/@web/test-runner/dist/bin.js';
  const env = { STABILITY: values.fast ? 'fast' : 'full', NODE_ENV: 'test' };
  const config = ['--config', 'web-test-runner.config.mjs', '--files', 'tests/stability/browser/**/*.test.ts'];
  return run(process.execPath, [runner, ...config], { env });
}
