/** The work behind `npm run lab:attack`. */
import { spawnSync } from 'node:child_process';
import {
  copyFileSync,
  existsSync,
  mkdirSync,
  mkdtempSync,
  readdirSync,
  readFileSync,
  rmSync,
  writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { gunzipSync } from 'node:zlib';
import { chromium } from 'playwright-core';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { peakBytes } from './peak.mjs';

const USAGE = `usage: npm run lab:attack -- [FOLDER (default ../shared/cases/attack)] [--only PATTERN] [--seconds N (default 40)]

Reads every file of a folder in Node, and shows each in Chromium with an honest scene of 400 splats (honest.ply of the folder) half a second later; both with a heap of
300 MB. Prints what came of it, the time and the most memory of a process (on Linux, which tells). Ends with an error where one crashes, ends without a named error, takes
more than 400 MB of the page's process, or keeps the honest scene waiting for more than a second.`;
const HEAP = '--max-old-space-size=300';
const MOST_PEAK = 400e6;
const MOST_WAIT_MS = 1_000;

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    only: { type: 'string', default: '' },
    seconds: { type: 'string', default: '40' },
    help: { type: 'boolean' },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}
const folder = resolve(positionals[0] ?? join(root, '../shared/cases/attack'));
if (!existsSync(join(folder, 'honest.ply'))) {
  console.error(`${folder}: expected a folder with honest.ply and hostile files\n\n${USAGE}`);
  process.exit(1);
}
const limitMs = 1000 * Number(values.seconds);
const served = mkdtempSync(join(tmpdir(), 'attack-'));
const files = readdirSync(folder).filter((file) => !/README|NOT-RUN/.test(file) && new RegExp(values.only).test(file));
const faults = [];

/** Where a file lies for the page: streamed scenes are known by the name of their manifest. */
function placed(file) {
  mkdirSync(join(served, file));
  const name =
    /detail/.test(file) && /\.json/.test(file) ? 'detail.json' : /^lod-.*\.json$/.test(file) ? 'lod-meta.json' : file;
  if (file.endsWith('.gz')) writeFileSync(join(served, file, name), gunzipSync(readFileSync(join(folder, file))));
  else copyFileSync(join(folder, file), join(served, file, name));
  return `/files/${encodeURIComponent(file)}/${name}`;
}

function inNode(file) {
  // Manifests and models are opened by the element alone.
  if (/detail|\.onnx$/.test(file)) return undefined;
  const script = join(root, 'tests/formats/support/read-measured.ts');
  const { stdout, stderr } = spawnSync(process.execPath, [HEAP, '--import', 'tsx', script, join(folder, file), ''], {
    encoding: 'utf8',
    cwd: root,
    timeout: limitMs,
  });
  return stdout === '' ? { result: `unnamed: ${stderr.slice(-200)}`, cpuMs: NaN, peak: NaN } : JSON.parse(stdout);
}

async function inChromium(file, port) {
  const browser = await chromium.launch({
    executablePath: findChromium(),
    args: [...gpuFlags(), `--js-flags=${HEAP}`],
  });
  try {
    const page = await browser.newPage();
    const crash = new Promise((done) => page.on('crash', () => done({ result: 'unnamed: the page crashed' })));
    await page.goto(`http://localhost:${port}/attack/index.html`);
    await page.waitForFunction('window.isReady');
    const run = page.evaluate(([...args]) => window.attack(...args), [placed(file), '/honest/honest.ply', limitMs]);
    const found = await Promise.race([run, crash]);
    return { ...found, peak: peakBytes() };
  } finally {
    await browser.close();
  }
}

const server = await serve({
  '/attack/': `${root}scripts/attack`,
  '/cdn/': `${root}packages/element/cdn`,
  '/honest/': folder,
  '/files/': served,
});
const { port } = server.address();
const megabytes = (bytes) => (bytes === undefined || Number.isNaN(bytes) ? '?' : `${Math.round(bytes / 1e6)} MB`);
console.log(
  'file | Node: result, CPU, memory | Chromium: result, time, memory of the page, longest standstill | honest scene beside it (alone)',
);
for (const file of files) {
  const node = inNode(file);
  const { result, ms, peak, standstill, beside, alone, besideResult } = await inChromium(file, port);
  const first = node ? `${node.result}, ${Math.round(node.cpuMs)} ms, ${megabytes(node.peak)}` : 'not read there';
  console.log(
    `${file} | ${first} | ${result}, ${ms} ms, ${megabytes(peak)}, ${standstill} ms | ${beside} ms (${alone} ms)`,
  );
  if (/unnamed|undefined/.test(`${node?.result} ${result}`.replace(/^undefined /, '')))
    faults.push(`${file}: no named error`);
  if (peak > MOST_PEAK) faults.push(`${file}: ${megabytes(peak)} of the page's process`);
  if (besideResult !== 'shown' || beside > alone + MOST_WAIT_MS)
    faults.push(`${file}: the honest scene came after ${beside} ms, alone ${alone}`);
}
server.closeAllConnections();
server.close();
rmSync(served, { recursive: true });
for (const fault of faults) console.error(fault);
process.exit(faults.length > 0 ? 1 : 0);
