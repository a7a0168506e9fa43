/**
 * `npm run lab -- flight`: the element flies over a streamed tileset on this machine's GPU. The tileset is made for it: copies of the skull, 576 for 50 million splats, in tiles of several levels.
 */
import { writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { chromium } from 'playwright-core';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';
import { makeCity } from '../../tests/support/flight-city.ts';

const USAGE = `usage: npm run lab -- flight [--speed N (fraction of the curve in 900 frames, default 0.5: up to 67 degrees a second)] [--frames N (default 900)] [--warm N (frames before it, default 180)] [--size WIDTHxHEIGHT (default 1920x1080)] [--megabytes N (memory of the page, default: that of the element)] [--blocks N (of 64 copies along a side, default 3)] [--out FILE]

Prints the error of missing pages and that of the splat budget in pixels, late frames, requests and memory.`;
const { values } = parseArgs({
  options: {
    ...{ speed: { type: 'string', default: '0.5' }, frames: { type: 'string', default: '900' } },
    ...{ warm: { type: 'string', default: '180' }, size: { type: 'string', default: '1920x1080' } },
    ...{ megabytes: { type: 'string' }, blocks: { type: 'string', default: '3' } },
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
const server = await serve({ '/flight/': join(root, 'scripts/flight'), '/cdn/': join(root, 'packages/element/cdn') });
let browser;
try {
  browser = await chromium.launch({ executablePath: findChromium(), args: gpuFlags() });
  const [width, height] = values.size.split('x');
  const page = await browser.newPage({ viewport: { width: Number(width), height: Number(height) } });
  const query = new URLSearchParams({ ...values, ...city, width, height, src: `${originOf(tiles)}/tileset.json` });
  await page.goto(`${originOf(server)}/flight/index.html?${query}`);
  await page.waitForFunction('window.report', undefined, { timeout: 600_000, polling: 500 });
  const report = await page.evaluate('window.report');
  if (report.error) throw new Error(report.error);
  const summary = { ...summed(report), ...city, requests: sum([...asked.values()]), files: asked.size };
  console.log(sentence(summary));
  console.log(JSON.stringify(summary, null, 2));
  if (values.out) writeFileSync(values.out, `${JSON.stringify({ ...summary, rows: report.rows })}\n`);
} finally {
  await browser?.close();
  for (const own of [server, tiles]) {
    own.closeAllConnections();
    own.close();
  }
}

function originOf(own) {
  return `http://localhost:${own.address().port}`;
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

function summed({ rows, bytes, renderer, reasons, readyMs, seconds }) {
  const of = (name) => rows.map((row) => row[name]);
  const fraction = (test) => rounded(rows.filter(test).length / rows.length);
  return {
    ...{ renderer, frames: rows.length, seconds, readyMs: Math.round(readyMs) },
    degreesPerSecond: rounded(60 * Math.max(...of('turned'))),
    errorPx: spread(of('error')),
    budgetPx: spread(of('budgetError')),
    overPixel: fraction(({ error, budgetError }) => Math.max(error, budgetError) > 1),
    interval: spread(of('ms').slice(1)),
    late: fraction(({ ms }) => ms > LATE_MS),
    pages: { resident: Math.max(...of('resident')), coming: spread(of('coming')) },
    megabytes: { scene: rounded(bytes.scene / 1e6), frames: rounded(bytes.frames / 1e6) },
    reasons,
  };
}

function sentence({ splats, degreesPerSecond, errorPx, budgetPx, late, requests, files }) {
  return `${splats} splats, up to ${degreesPerSecond} degrees a second: missing pages ${errorPx.mean} px on average (worst ${errorPx.worst}), splat budget ${budgetPx.mean} px, ${(100 * late).toFixed(1)} % of frames late, ${requests} requests for ${files} files`;
}
