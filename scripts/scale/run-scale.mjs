/**
 * `npm run lab -- scale`: builds a streamed scene in one run and in parts, compares their bytes, kills a part, and computes
 * from these measurements what larger scenes take. It separates what it measured from what it computed.
 */
import { spawn, spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import {
  closeSync,
  existsSync,
  mkdtempSync,
  openSync,
  readdirSync,
  readFileSync,
  rmSync,
  statSync,
  writeSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { setTimeout } from 'node:timers/promises';
import { parseArgs } from 'node:util';
import { SceneCells } from '@gaussian-splat/optimize/pages';

const USAGE = `usage: npm run lab -- scale [--splats N] [--cells MEMORY] [--folder FOLDER] [--keep]

  --splats N        splats of the scene that is built (default 1000000)
  --cells MEMORY    --memory of the builds (default 320MB: cells of 65,536 splats)
  --folder FOLDER   where the scene and its pages go (default: a temporary folder)
  --keep            does not remove them`;
const { values } = parseArgs({
  options: {
    ...{ splats: { type: 'string', default: '1000000' }, cells: { type: 'string', default: '320MB' } },
    ...{ folder: { type: 'string' }, keep: { type: 'boolean' }, help: { type: 'boolean' } },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit();
}
const splats = Number(values.splats);
const folder = values.folder ?? mkdtempSync(join(tmpdir(), 'gs-scale-'));
const BIN = 'packages/cli/bin/gaussian-splat.mjs';
/** Prints the CPU seconds and the peak memory of a command when it ends. */
const USAGE_OF = `data:text/javascript,process.on('exit',()=>{const{userCPUTime:u,systemCPUTime:s,maxRSS:m}=process.resourceUsage();console.error('USED',(u+s)/1e6,m/1024)})`;
const argsOf = (args) => [
  '--import',
  USAGE_OF,
  BIN,
  'detail',
  scene,
  '--degree',
  '0',
  '--memory',
  values.cells,
  ...args,
];

/** Runs a build, and returns its CPU seconds and its peak memory in MB. */
function build(...args) {
  const { status, stdout, stderr } = spawnSync(process.execPath, argsOf(args), { encoding: 'utf8' });
  if (status !== 0) throw new Error(`detail ${args.join(' ')}: ${stdout}${stderr}`);
  const [, cpu, memory] = /USED (\S+) (\S+)/.exec(stderr).map(Number);
  return { cpu, memory };
}

/** Mulberry32. */
function randomFrom(seed) {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** Writes a PLY of blocks on hills. A square of 64 x 64 units has 65,536 splats and a seed of its own, so that none repeats. */
function writeScene(path) {
  const names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2'];
  const all = [...names, 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
  const head = ['ply', 'format binary_little_endian 1.0', `element vertex ${splats}`];
  const file = openSync(path, 'w');
  writeSync(file, [...head, ...all.map((name) => `property float ${name}`), 'end_header\n'].join('\n'));
  const [square, side] = [65_536, 64];
  const row = Math.ceil(Math.sqrt(splats / square));
  for (let first = 0, k = 0; first < splats; first += square, k++) {
    const random = randomFrom(k + 1);
    const count = Math.min(square, splats - first);
    const rows = new Float32Array(all.length * count);
    const blocks = Array.from({ length: 9 }, () => [
      random() * side,
      random() * side,
      4 + 8 * random(),
      6 + 24 * random(),
    ]);
    for (let i = 0; i < count; i++) {
      const [x, z] = [random() * side, random() * side];
      const block = blocks.find(([bx, bz, half]) => Math.abs(x - bx) < half && Math.abs(z - bz) < half);
      const ground = 3 * Math.sin(0.05 * (x + side * k)) * Math.cos(0.04 * z);
      const height = block ? ground + block[3] * (random() < 0.5 ? random() : 1) : ground;
      const [gray, turn] = [random() - 0.5, 2 * Math.PI * random()];
      const place = [side * (k % row) + x, -height, side * Math.floor(k / row) + z];
      const color = [gray + (block ? 0.4 : 0), gray + 0.2, gray - (block ? 0.1 : 0.3)];
      const sizes = [0, 1, 2].map((axis) => Math.log(0.1 + 0.15 * random()) - (axis === 1 ? 1 : 0));
      rows.set(
        [...place, ...color, 4 * random(), ...sizes, Math.cos(turn / 2), 0, Math.sin(turn / 2), 0],
        all.length * i,
      );
    }
    writeSync(file, new Uint8Array(rows.buffer));
  }
  closeSync(file);
}

function filesIn(path) {
  return readdirSync(path, { recursive: true })
    .map(String)
    .filter((name) => statSync(join(path, name)).isFile())
    .sort();
}

function digest(path) {
  const hash = createHash('sha256');
  for (const name of filesIn(path)) hash.update(name).update(readFileSync(join(path, name)));
  return hash.digest('hex');
}

const scene = join(folder, 'scene.ply');
const out = (name) => join(folder, name);
const line = (name, { cpu, memory }) =>
  console.log(`  ${name.padEnd(24)} ${cpu.toFixed(1)} s of CPU, ${memory.toFixed(0)} MB at most`);

writeScene(scene);
console.log(`measured: ${splats} splats, --memory ${values.cells}`);
const whole = build('--out', out('one'));
line('one run', whole);
const expected = digest(out('one'));
const steps = {};
for (const of of [2, 4]) {
  const path = out(`parts-${of}`);
  steps[of] = [];
  for (let index = of; index >= 1; index--) steps[of].push(build('--out', path, '--part', `${index}/${of}`));
  const joined = build('--out', path, '--join');
  steps[of].forEach((part, k) => line(`part ${of - k} of ${of}`, part));
  line('join', joined);
  console.log(`  ${of} parts: ${digest(path) === expected ? 'the same bytes' : 'OTHER BYTES'}`);
  if (of === 4) steps.join = joined;
}
{
  const path = out('killed');
  const args = ['--out', path, '--part', '1/2'];
  const killed = spawn(process.execPath, argsOf(args), { stdio: 'ignore' });
  const ended = new Promise((resolve) => killed.once('exit', (_, signal) => resolve(signal)));
  const unfinished = join(path, 'unfinished');
  while (!existsSync(unfinished) || !readdirSync(unfinished).some((name) => name.endsWith('.top')))
    await setTimeout(50);
  killed.kill('SIGKILL');
  const signal = await ended;
  for (const index of ['1/2', '2/2']) build('--out', path, '--part', index);
  build('--out', path, '--join');
  console.log(
    `  a part ended by ${signal} and run again: ${digest(path) === expected ? 'the same bytes' : 'OTHER BYTES'}`,
  );
}

const pages = filesIn(join(out('one'), 'pages'));
const bytes = pages.reduce((sum, name) => sum + statSync(join(out('one'), 'pages', name)).size, 0);
const manifestBytes = statSync(join(out('one'), 'detail.json')).size;
console.log(
  `  ${pages.length} files, ${(bytes / 1e6).toFixed(1)} MB, ${(bytes / splats).toFixed(2)} bytes a splat; manifest ${(manifestBytes / 1e3).toFixed(0)} kB`,
);

// The first part that ran has read and sorted the scene, besides a quarter of the cells.
const [first, ...others] = steps[4];
const mean = others.reduce((sum, { cpu }) => sum + cpu, 0) / others.length;
const reading = Math.max(0, first.cpu - mean);
const START = build('--help').cpu;
const perSplat = {
  read: reading / splats,
  map: (4 * (mean - START)) / splats,
  join: (steps.join.cpu - START) / splats,
};
const hours = (seconds) => (seconds < 5400 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(1)} h`);
console.log('computed, from CPU seconds of each step times the number of splats, on cores like this one:');
for (const count of [100e6, 1e9]) {
  const cells = new SceneCells(count, 8);
  const times = [1, 2, 4, 64].map((workers) => {
    const seconds = count * (perSplat.read + perSplat.map / workers + perSplat.join);
    return `${workers}: ${hours(seconds)}`;
  });
  const size = ((bytes / splats) * count) / 1e9;
  const listed = ((manifestBytes / pages.length) * cells.pages.length) / 1e6;
  console.log(
    `  ${count / 1e6} million splats: ${size.toFixed(1)} GB in ${cells.pages.length} files, manifest ${listed.toFixed(1)} MB`,
  );
  // docs/guide/many-machines.md: 56 bytes a splat, twice while parts run.
  console.log(`    while it is built, up to ${((112 * count) / 1e9).toFixed(0)} GB more on the disk`);
  console.log(
    `    by workers, ${times.join(', ')}; of it reading, which is not divided, ${hours(count * perSplat.read)}`,
  );
}
if (values.keep) console.log(folder);
else rmSync(values.folder === undefined ? folder : scene, { recursive: true });
