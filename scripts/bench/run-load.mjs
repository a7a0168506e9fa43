/** `npm run lab -- load`: the cost of loading ordinary files in Chromium with our element and with others: time from the navigation to the first preview and to the first frame of the whole scene, the page's longest task and the peak memory of its process. */
import { statSync, writeFileSync } from 'node:fs';
import { availableParallelism } from 'node:os';
import { basename, dirname, join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { peakBytes } from '../attack/peak.mjs';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root, run } from '../lib/run.mjs';

const USAGE = `usage: npm run lab -- load FILE ... [options]

  FILE             scenes: .ply, .compressed.ply, .spz, .sog. node scripts/tile-scene.mjs makes large ones
  --viewers A,B    from ours, spark, playcanvas (default all); each opens each file in a separate browser
  --rounds N       loads of each, in turns; the median counts (default 5)
  --cores N        pins the browser to the first N cores (Linux)
  --seconds N      time limit of a load (default 120)
  --out FILE       file for the figures, as JSON`;

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    viewers: { type: 'string', default: 'ours,spark,playcanvas' },
    rounds: { type: 'string', default: '5' },
    cores: { type: 'string' },
    seconds: { type: 'string', default: '120' },
    out: { type: 'string' },
    help: { type: 'boolean' },
  },
});
if (values.help || positionals.length === 0) {
  console.log(USAGE);
  process.exit(values.help ? 0 : 2);
}

const ALL_CORES = availableParallelism();

/** Runs a function while processes that start are pinned to the first cores, if their number is given. */
async function pinned(start) {
  const cores = Number(values.cores ?? 0);
  const pin = (list) => run('taskset', ['-p', '-c', list, String(process.pid)], { stdio: 'ignore' });
  if (cores > 0 && pin(`0-${cores - 1}`) !== 0) throw new Error('--cores needs taskset, which Linux has');
  try {
    return await start();
  } finally {
    if (cores > 0) pin(`0-${ALL_CORES - 1}`);
  }
}

/** One load in a browser that has just been started. */
async function load(viewer, path, port) {
  const browser = await pinned(() => chromium.launch({ executablePath: findChromium(), args: gpuFlags() }));
  try {
    const page = await browser.newPage();
    const crash = new Promise((_, reject) => page.on('crash', () => reject(new Error('the page crashed'))));
    crash.catch(() => undefined);
    const before = peakBytes();
    const timeout = 1000 * Number(values.seconds);
    await page.goto(`http://localhost:${port}/load/${viewer}.html?file=${encodeURIComponent(path)}`);
    await Promise.race([page.waitForFunction('window.result', undefined, { timeout }), crash]);
    const { error, ...found } = await page.evaluate('window.result');
    if (error) throw new Error(error);
    return { ...found, peakBytes: peakBytes(), emptyBytes: before };
  } finally {
    await browser.close();
  }
}

const median = (numbers) => numbers.sort((a, b) => a - b)[numbers.length >> 1];
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
  const viewers = values.viewers.split(',');
  const loads = new Map(viewers.map((viewer) => [viewer, []]));
  // In turns, because a machine may be busy for a while.
  for (let round = 0; round < Number(values.rounds); round++)
    for (const viewer of viewers) {
      const path = `/files/${encodeURIComponent(basename(file))}`;
      loads.get(viewer).push(await load(viewer, path, port).catch((error) => ({ error })));
    }
  for (const [viewer, rounds] of loads) {
    const fine = rounds.filter(({ error }) => !error);
    if (fine.length === 0) {
      console.log(`  ${viewer.padEnd(12)} ${String(rounds[0].error.message).split('\n')[0].slice(0, 100)}`);
      continue;
    }
    const found = (name) => median(fine.map((row) => row[name]).filter((value) => value !== undefined));
    const names = ['codeMs', 'previewMs', 'readyMs', 'loadMs', 'longestMs', 'peakBytes', 'emptyBytes'];
    const row = {
      ...{ file: basename(file), viewer, loads: fine.length },
      ...Object.fromEntries(names.map((name) => [name, found(name)])),
    };
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
