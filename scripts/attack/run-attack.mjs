/** The work behind `npm run lab -- attack`. */
import { spawnSync } from 'node:child_process';
import {
  copyFileSync,
  cpSync,
  existsSync,
  mkdirSync,
  mkdtempSync,
  readdirSync,
  readFileSync,
  rmSync,
  statSync,
  writeFileSync,
} from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { gunzipSync } from 'node:zlib';
import { chromium } from 'playwright-core';
import { findChromium, gpuFlags } from '../lib/chromium.mjs';
import { root } from '../lib/run.mjs';
import { serve } from '../../packages/cli/src/lib/server.mjs';
import { peakBytes } from './peak.mjs';

const USAGE = `usage: npm run lab -- attack [FOLDER (default ../shared/cases/attack)] [--only PATTERN] [--renderer webgl] [--seconds N (default 40)] [--copies N (default 1)]

Reads every scene file of a folder in Node, and shows each in Chromium, files named mesh-* and csp-* as meshes, with an honest scene of 400 splats (honest.ply of the folder, or of
../attack) half a second later, and again when it is removed; both with a heap of 300 MB. With --copies 9, nine elements show the file at once. A folder within the folder is a streamed
scene or a tileset, a .floor is walked on. Prints the result, the time, the maximum memory of
the page's process and of the GPU's (on Linux) above an empty page, the requests for the file and those to another origin. Ends with an error if one crashes, ends without a named error, takes more than
400 MB of a process, requests more than 1,000 files and one for each KiB, blocks the main thread for more than 100 ms at once, asks another origin, or delays the honest scene by more than a second.`;
const HEAP = '--max-old-space-size=300';
const MAX_PEAK = 400e6;
const MAX_WAIT_MS = 1_000;
const MAX_TASK_MS = 100;
/** The port of the other origin that the cases name. */
const FOREIGN_PORT = 18_602;

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    only: { type: 'string', default: '' },
    renderer: { type: 'string', default: '' },
    seconds: { type: 'string', default: '40' },
    copies: { type: 'string', default: '1' },
    help: { type: 'boolean' },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}
const folder = resolve(positionals[0] ?? join(root, '../shared/cases/attack'));
const honestFolder = [folder, join(folder, '../attack')].find((each) => existsSync(join(each, 'honest.ply')));
if (honestFolder === undefined) {
  console.error(`${folder}: expected a folder with honest.ply and hostile files\n\n${USAGE}`);
  process.exit(1);
}
const limitMs = 1000 * Number(values.seconds);
const served = mkdtempSync(join(tmpdir(), 'attack-'));
const files = readdirSync(folder).filter(
  (file) => !/README|NOT-RUN|\.pt$|^page-names$/.test(file) && new RegExp(values.only).test(file),
);
const faults = [];

/** The address of a file for the page: the name of the manifest identifies streamed scenes. */
function placed(file) {
  if (statSync(join(folder, file)).isDirectory()) {
    cpSync(join(folder, file), join(served, file), { recursive: true });
    if (file === 'lod-many') writeManyParts(join(served, file));
    const name = ['tileset.json', 'lod-meta.json'].find((each) => existsSync(join(served, file, each)));
    return `/files/${encodeURIComponent(file)}/${name}`;
  }
  mkdirSync(join(served, file));
  const name =
    /detail/.test(file) && /\.json/.test(file) ? 'detail.json' : /^lod-.*\.json$/.test(file) ? 'lod-meta.json' : file;
  if (file.endsWith('.gz')) writeFileSync(join(served, file, name), gunzipSync(readFileSync(join(folder, file))));
  else copyFileSync(join(folder, file), join(served, file, name));
  return `/files/${encodeURIComponent(file)}/${name}`;
}

/** An index of 300 copies of part.sog, one splat of each. */
function writeManyParts(to) {
  const filenames = Array.from({ length: 300 }, (_, k) => `${k}.sog`);
  for (const name of filenames) copyFileSync(join(to, 'part.sog'), join(to, name));
  const bound = { min: [0, 0, 0], max: [1, 1, 1] };
  const children = filenames.map((_, file) => ({ bound, lods: { 0: { file, offset: 0, count: 1 } } }));
  writeFileSync(
    join(to, 'lod-meta.json'),
    JSON.stringify({ version: 1, lodLevels: 1, filenames, tree: { bound, children } }),
  );
}

const isMesh = (file) => /^(mesh|csp)-/.test(file);

function inNode(file) {
  // Manifests, models, views and meshes are opened by the element alone.
  if (/detail|views|\.onnx$|\.4dgs$|\.floor$/.test(file) || isMesh(file) || statSync(join(folder, file)).isDirectory())
    return undefined;
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
    await page.goto(`http://localhost:${port}/attack/index.html${values.renderer && `?renderer=${values.renderer}`}`);
    await page.waitForFunction('window.isReady');
    const empty = [peakBytes(), peakBytes('gpu-process')];
    const run = page.evaluate(
      ([...args]) => window.attack(...args),
      [placed(file), '/honest/honest.ply', limitMs, isMesh(file), Number(values.copies)],
    );
    const found = await Promise.race([run, crash]);
    return { ...found, peak: peakBytes() - empty[0], gpuPeak: peakBytes('gpu-process') - empty[1] };
  } finally {
    await browser.close();
  }
}

const server = await serve({
  '/attack/': `${root}scripts/attack`,
  '/cdn/': `${root}packages/element/cdn`,
  '/honest/': honestFolder,
  '/files/': served,
});
const { port } = server.address();
let [requests, sentBytes] = [0, 0];
server.on('request', ({ url }, response) => {
  if (!url.startsWith('/files/')) return;
  requests++;
  response.on('finish', () => (sentBytes += Number(response.getHeader('content-length') ?? 0)));
});
let foreignRequests = 0;
const foreign = createServer((_, response) => {
  foreignRequests++;
  response.writeHead(200, { 'Access-Control-Allow-Origin': '*' }).end('a');
}).listen(FOREIGN_PORT);
const megabytes = (bytes) => (bytes === undefined || Number.isNaN(bytes) ? '?' : `${Math.round(bytes / 1e6)} MB`);
console.log(
  'file | Node: result, CPU, memory | Chromium: result, time, memory of page and GPU process, longest standstill, longest task of the page | honest scene beside it, later (alone) | requests, and foreign ones',
);
for (const file of files) {
  const node = inNode(file);
  foreignRequests = requests = sentBytes = 0;
  const found = await inChromium(file, port);
  const { result, ms, peak, gpuPeak, standstill, task, beside, alone, besideResult, later, laterResult } = found;
  const first = node ? `${node.result}, ${Math.round(node.cpuMs)} ms, ${megabytes(node.peak)}` : 'not read there';
  console.log(
    `${file} | ${first} | ${result}, ${ms} ms, ${megabytes(peak)} + ${megabytes(gpuPeak)}, ${standstill} ms, ${task} ms | ` +
      `${beside} ms, ${later} ms (${alone} ms) | ${requests} and ${foreignRequests}`,
  );
  const isNamed = !/unnamed|undefined|nothing for/.test(`${node?.result} ${result}`.replace(/^undefined /, ''));
  if (!isNamed) faults.push(`${file}: no named error (${result})`);
  for (const [what, bytes] of Object.entries({ page: peak, GPU: gpuPeak }))
    if (bytes > MAX_PEAK) faults.push(`${file}: ${megabytes(bytes)} of the process of the ${what}`);
  if (task > MAX_TASK_MS) faults.push(`${file}: a task of ${task} ms on the main thread`);
  for (const [when, took, came] of [
    ['beside it', beside, besideResult],
    ['later', later, laterResult],
  ])
    if (came !== 'shown' || took > alone + MAX_WAIT_MS)
      faults.push(`${file}: the honest scene ${when} came after ${took} ms, alone ${alone}`);
  // The last responses may not be finished.
  const maxRequests = 1_010 * Number(values.copies) + sentBytes / 1024;
  if (requests > maxRequests) faults.push(`${file}: ${requests} requests`);
  if (foreignRequests > 0) faults.push(`${file}: ${foreignRequests} requests to another origin`);
}
foreign.closeAllConnections();
foreign.close();
server.closeAllConnections();
server.close();
rmSync(served, { recursive: true });
for (const fault of faults) console.error(fault);
process.exit(faults.length > 0 ? 1 : 0);
