/**
 * `npm run lab -- flight`: the element, or a layer of MapLibre, flies over a streamed tileset on this machine's GPU. The tileset is made for it: copies of the skull, 576 for 50 million splats, in tiles of several levels.
 */
import { cpSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { build } from 'esbuild';
import { chromium } from 'playwright-core';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';
import { makeCity } from '../../tests/support/flight-city.ts';

const USAGE = `usage: npm run lab -- flight [--in element|maplibre|element,maplibre (default: element)] [--speed N (fraction of the curve in 900 frames, default 0.5: up to 67 degrees a second)] [--frames N (at 60 Hz, default 900)] [--warm N (frames before it, default 180)] [--size WIDTHxHEIGHT (default 1920x1080)] [--megabytes N (memory of the page, default: that of the element)] [--splats N (of the layer on the GPU, default 6500000)] [--blocks N (of 64 copies along a side, default 3)] [--out FILE]

Prints the error of missing pages and that of the splat budget in pixels, late frames, requests and memory; of the layer also the milliseconds of its draw calls.`;
const { values } = parseArgs({
  options: {
    ...{ speed: { type: 'string', default: '0.5' }, frames: { type: 'string', default: '900' } },
    ...{ warm: { type: 'string', default: '180' }, size: { type: 'string', default: '1920x1080' } },
    ...{ megabytes: { type: 'string' }, blocks: { type: 'string', default: '3' } },
    ...{ in: { type: 'string', default: 'element' }, splats: { type: 'string', default: '6500000' } },
    ...{ out: { type: 'string' }, help: { type: 'boolean' } },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}

/** Milliseconds above which a frame at 60 Hz was late. */
const LATE_MS = 25;
const { files, ...city } = await makeCity(join(root, 'demo/scenes/skull.spz'), Number(values.blocks));
/** Number of requests for each file of the tileset. */
const asked = new Map();
const tiles = await serveTiles();
const kinds = values.in.split(',');
const layer = kinds.includes('maplibre') ? await bundledLayer() : undefined;
const reports = [];
const server = await serve({
  ...{ '/flight/': join(root, 'scripts/flight'), '/cdn/': join(root, 'packages/element/cdn') },
  ...(layer && { '/map/': layer }),
});
let browser;
try {
  browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
  const [width, height] = values.size.split('x');
  const src = `${originOf(tiles)}/tileset.json`;
  for (const kind of kinds) {
    asked.clear();
    const page = await browser.newPage({ viewport: { width: Number(width), height: Number(height) } });
    const query = new URLSearchParams({ ...values, ...city, width, height, src, in: kind, maxSplats: values.splats });
    await page.goto(`${originOf(server)}/flight/index.html?${query}`);
    await page.waitForFunction('window.report', undefined, { timeout: 600_000, polling: 500 });
    const report = await page.evaluate('window.report');
    if (report.error) throw new Error(report.error);
    const requests = sum([...asked.values()]);
    const summary = { in: kind, ...summed(report), ...city, requests, files: asked.size };
    console.log(sentence(summary));
    console.log(JSON.stringify(summary, null, 2));
    reports.push({ ...summary, rows: report.rows });
    await page.close();
  }
  if (values.out) writeFileSync(values.out, `${JSON.stringify(reports)}\n`);
} finally {
  await browser?.close();
  for (const own of [server, tiles]) {
    own.closeAllConnections();
    own.close();
  }
  if (layer) rmSync(layer, { recursive: true });
}

function originOf(own) {
  return `http://localhost:${own.address().port}`;
}

/** Bundles the layer, with the scripts of its workers. @returns the folder */
async function bundledLayer() {
  const folder = mkdtempSync(join(tmpdir(), 'flight-'));
  await build({
    entryPoints: ['maplibre', 'sorter'].map((name) => join(root, `scripts/flight/${name}.js`)),
    ...{ outdir: folder, bundle: true, splitting: true, format: 'esm', minify: true, logLevel: 'warning' },
  });
  const script = 'maplibre-gl-worker.mjs';
  cpSync(join(root, 'node_modules/maplibre-gl/dist', script), join(folder, script));
  return folder;
}

/** Serves the tileset from memory, so that the flight does not wait for a disk. */
async function serveTiles() {
  const own = createServer(({ url }, response) => {
    const bytes = files.get(url.slice(1).replace(/~\d+\//g, ''));
    asked.set(url, 1 + (asked.get(url) ?? 0));
    const headers = { 'access-control-allow-origin': '*', 'content-length': bytes?.length ?? 0 };
    response.writeHead(bytes ? 200 : 404, { ...headers, 'cache-control': 'max-age=3600' }).end(bytes);
  });
  await new Promise((resolve) => own.listen(0, '127.0.0.1', resolve));
  return own;
}

function sum(numbers) {
  return numbers.reduce((total, value) => total + value, 0);
}

/** Mean, median, 95 % and largest of some numbers. */
function spread(numbers) {
  const sorted = [...numbers].sort((a, b) => a - b);
  const at = (share) => rounded(sorted[Math.floor(share * (sorted.length - 1))]);
  return { mean: rounded(sum(numbers) / numbers.length), median: at(0.5), p95: at(0.95), worst: at(1) };
}

function rounded(value) {
  return Math.round(1000 * value) / 1000;
}

function summed({ rows, megabytes, renderer, reasons, readyMs, seconds, longTasks }) {
  const of = (name) => rows.map((row) => row[name]);
  const fraction = (test) => rounded(rows.filter(test).length / rows.length);
  return {
    ...{ renderer, frames: rows.length, seconds, readyMs: Math.round(readyMs) },
    degreesPerSecond: rounded(Math.max(...of('turned'))),
    errorPx: spread(of('error')),
    budgetPx: spread(of('budgetError')),
    overPixel: fraction(({ error, budgetError }) => Math.max(error, budgetError) > 1),
    interval: spread(of('ms').slice(1)),
    late: fraction(({ ms }) => ms > LATE_MS),
    pages: { resident: Math.max(...of('resident')), coming: spread(of('coming')) },
    pageMegabytes: rounded(Math.max(...of('bytes')) / 1e6),
    ...(rows[0].drawMs !== undefined && { drawMs: spread(of('drawMs')) }),
    ...{ megabytes, longTasks, reasons },
  };
}

function sentence({ in: kind, splats, degreesPerSecond, errorPx, budgetPx, late, requests, files }) {
  return `${kind}: ${splats} splats, up to ${degreesPerSecond} degrees a second: missing pages ${errorPx.mean} px on average (worst ${errorPx.worst}), splat budget ${budgetPx.mean} px, ${(100 * late).toFixed(1)} % of frames late, ${requests} requests for ${files} files`;
}
