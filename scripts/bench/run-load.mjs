/** `npm run lab -- load`: the cost of loading ordinary files in Chromium with our element and with others: time to the first preview and to the scene, the page's longest task and the peak memory of its process. */
import { statSync, writeFileSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { peakBytes } from '../attack/peak.mjs';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';

const USAGE = `usage: npm run lab -- load FILE ... [options]

  FILE             scenes: .ply, .compressed.ply, .spz, .sog. node scripts/tile-scene.mjs makes large ones
  --viewers A,B    from ours, spark, playcanvas (default all); each opens each file in a separate browser
  --rounds N       loads of each; the minimum time counts (default 2)
  --seconds N      time limit of a load (default 120)
  --out FILE       file for the figures, as JSON`;

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    viewers: { type: 'string', default: 'ours,spark,playcanvas' },
    rounds: { type: 'string', default: '2' },
    seconds: { type: 'string', default: '120' },
    out: { type: 'string' },
    help: { type: 'boolean' },
  },
});
if (values.help || positionals.length === 0) {
  console.log(USAGE);
  process.exit(values.help ? 0 : 2);
}

/** One load in a browser that has just been started. */
async function load(viewer, path, port) {
  const browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
  try {
    const page = await browser.newPage();
    const crash = new Promise((_, reject) => page.on('crash', () => reject(new Error('the page crashed'))));
    crash.catch(() => undefined);
    await page.goto(`http://localhost:${port}/load/${viewer}.html`);
    await page.waitForFunction('window.load');
    const before = peakBytes();
    const limit = AbortSignal.timeout(1000 * Number(values.seconds));
    const late = new Promise((_, reject) => limit.addEventListener('abort', () => reject(new Error('not in time'))));
    const found = await Promise.race([page.evaluate((url) => window.load(url), path), crash, late]);
    return { ...found, peakBytes: peakBytes(), emptyBytes: before };
  } finally {
    await browser.close();
  }
}

const megabytes = (bytes) => `${Math.round(bytes / 1e6)} MB`;
const seconds = (ms) => (ms === undefined ? '   -' : (ms / 1000).toFixed(2).padStart(5));
const rows = [];
for (const file of positionals.map((each) => resolve(process.env.INIT_CWD ?? process.cwd(), each))) {
  const server = await serve({
    '/load/': join(root, 'scripts/bench/load'),
    '/cdn/': join(root, 'packages/element/cdn'),
    '/three/': join(root, 'node_modules/three'),
    '/spark/': join(root, 'node_modules/@sparkjsdev/spark/dist'),
    '/playcanvas/': join(root, 'node_modules/playcanvas'),
    '/files/': dirname(file),
  });
  const { port } = server.address();
  console.log(`${basename(file)}, ${megabytes(statSync(file).size)}`);
  for (const viewer of values.viewers.split(',')) {
    const rounds = [];
    for (let round = 0; round < Number(values.rounds); round++)
      rounds.push(
        await load(viewer, `/files/${encodeURIComponent(basename(file))}`, port).catch((error) => ({ error })),
      );
    const fine = rounds.filter(({ error }) => !error);
    if (fine.length === 0) {
      console.log(`  ${viewer.padEnd(12)} ${String(rounds[0].error.message).split('\n')[0].slice(0, 100)}`);
      continue;
    }
    const min = (name) => fine.reduce((max, row) => (row[name] < (max ?? Infinity) ? row[name] : max), undefined);
    const row = { file: basename(file), viewer, previewMs: min('previewMs'), loadMs: min('loadMs') };
    Object.assign(row, {
      longestMs: min('longestMs'),
      peakBytes: min('peakBytes'),
      emptyBytes: min('emptyBytes'),
    });
    rows.push(row);
    console.log(
      `  ${viewer.padEnd(12)} preview ${seconds(row.previewMs)} s  load ${seconds(row.loadMs)} s  longest task ${Math.round(row.longestMs)} ms  ` +
        `memory ${megabytes(row.peakBytes)} (${megabytes(row.emptyBytes)} before)`,
    );
  }
  server.closeAllConnections();
  server.close();
}
if (values.out)
  writeFileSync(values.out, `${JSON.stringify({ kind: 'load', date: new Date().toISOString(), rows }, null, 2)}\n`);
process.exit(0);
