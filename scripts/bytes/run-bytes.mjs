/**
 * `npm run lab -- bytes`: bytes against accuracy of scene files, ours and others', on the captured scenes of ../shared/data. Each is read, drawn in held-out views, and held against the scene that it was made of.
 * What takes long to make is kept in --work and taken from there the next time.
 */
import { existsSync, mkdirSync, readdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { boundsOf } from '@gaussian-splat/core';
import { encodingsFor, GpuEvaluator, viewsAround } from '@gaussian-splat/optimize';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { root } from '../lib/run.mjs';
import { drawChart } from './chart.mjs';
import { halfTurned, make, own, read, readFolder, timed, TRANSFORM } from './files.mjs';
import { writeSplat } from './splat.mjs';

const USAGE = `usage: npm run lab -- bytes [options]

  --data FOLDER    the captured scenes (default ../shared/data)
  --work FOLDER    where files that are made are kept (default bench-results/bytes)
  --out FOLDER     where bytes.json and bytes.svg go (default docs/frontier)
  --scenes A,B     of skull, playbot3, st-peter (default all); others keep their figures
  --views N        held-out views (default 8)
  --score-views N  views that score splats (default 24; 216 is the default of the commands, for a GPU)
  --kept           of what takes long to make only what is in --work
`;

/** Bytes a second of 20 Mbit/s. */
const RATE = 2.5e6;
const SCENES = {
  'st-peter': { source: 'scenes/st-peter.sog', files: { 'SOG (its own)': 'scenes/st-peter.sog' } },
  playbot3: {
    source: 'formats/playbot3.ply',
    files: {
      'PLY, float32': 'formats/playbot3.ply',
      'compressed PLY': 'formats/playbot3.compressed.ply',
      'SPZ 3': 'formats/playbot3.niantic-v3.spz',
      'SPZ 4': 'formats/playbot3.niantic-v4.spz',
      'ksplat 0': 'formats/playbot3.c0.sh2.ksplat',
      'ksplat 1': 'formats/playbot3.c1.sh2.ksplat',
      'ksplat 2, SH1': 'formats/playbot3.c2.sh1.ksplat',
    },
  },
  skull: { source: 'scenes/skull.ply', files: { 'PLY, float32': 'scenes/skull.ply' } },
};
/** The output of another tool for a scene that has no such file. */
const TRANSFORMED = { SOG: 'sog', 'compressed PLY': 'compressed.ply', 'SPZ 4': 'spz' };
const DECIBELS = [40, 50];

const text = (fallback) => ({ type: 'string', default: fallback });
const { values } = parseArgs({
  options: {
    data: text(join(root, '../shared/data')),
    work: text(join(root, 'bench-results/bytes')),
    out: text(join(root, 'docs/frontier')),
    scenes: text(Object.keys(SCENES).join(',')),
    views: text('8'),
    'score-views': text('24'),
    kept: { type: 'boolean' },
    help: { type: 'boolean' },
  },
});

async function measure(scene, { source, files }, device) {
  const path = (file) => join(values.data, file);
  const made = (file) => join(values.work, `${scene}.${file}`);
  const cloud = await read(path(source));
  const around = (count, seed) => viewsAround(boundsOf(cloud), count, { seed });
  const views = { scored: around(1, 10), searched: around(1, 1), heldOut: around(Number(values.views), 5) };
  const evaluator = await GpuEvaluator.create(device, cloud, views);
  const rows = [];
  const note = async (name, isOwn, bytes, first, decodeMs, found) => {
    const errors = await evaluator.compare(found, 'heldOut');
    const dB = (error) => Math.min(99, -10 * Math.log10(error + 1e-12));
    const mean = errors.reduce((sum, error) => sum + error, 0) / errors.length;
    // A whole file is decoded before its first frame; of a folder the first page is.
    const firstMs = (1000 * first) / RATE + (first < bytes ? (decodeMs * first) / bytes : decodeMs);
    rows.push({
      name,
      isOwn,
      bytes,
      decodeMs,
      firstBytes: first,
      firstMs,
      decibels: dB(mean),
      worst: dB(Math.max(...errors)),
    });
    const { worst } = rows.at(-1);
    console.log(
      `  ${name.padEnd(28)} ${(bytes / cloud.count).toFixed(2)} bytes a splat, ${worst.toFixed(2)} dB, ${decodeMs.toFixed(0)} ms`,
    );
  };
  const file = async (name, isOwn, at, turn = (found) => found) => {
    const [ms, found] = await timed(() => read(at));
    const { size } = statSync(at);
    await note(name, isOwn, size, size, ms, turn(found));
  };
  for (const [name, at] of Object.entries(files)) await file(name, false, path(at));
  for (const [name, extension] of Object.entries(TRANSFORMED)) {
    if (Object.keys(files).some((other) => other.startsWith(name))) continue;
    const args = ['--yes', TRANSFORM, '-q', '-w', '-g', 'cpu', path(source), made(extension)];
    if (await make(made(extension), 'npx', args, values.kept))
      await file(name, false, made(extension), extension === 'spz' ? halfTurned : undefined);
  }
  writeFileSync(made('splat'), writeSplat(cloud));
  await file('splat', false, made('splat'));
  const whole = { cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) };
  for (const encoding of encodingsFor('a.spz').filter((_, k, all) => k === 0 || k === all.length - 1)) {
    const at = made(`own-${/\d+ bits/.exec(encoding.title)?.[0].replace(' ', '-')}.spz`);
    writeFileSync(at, await encoding.write(whole));
    await file(`SPZ 3, ours, ${/\d+ bits/.exec(encoding.title)?.[0]}`, true, at);
  }
  for (const dB of DECIBELS) {
    const folder = made(`pages-${dB}`);
    if (
      await make(
        folder,
        process.execPath,
        own('detail', path(source), '--out', folder, '--min-psnr', String(dB), '--score-views', values['score-views']),
        values.kept,
      )
    ) {
      const [ms, found] = await timed(() => readFolder(folder));
      await note(`our pages, ${dB} dB`, true, found.bytes, found.first, ms, found.cloud);
    }
    const smaller = made(`own-${dB}.sog`);
    const options = ['--min-psnr', String(dB), '--score-views', values['score-views'], '--out', smaller];
    if (await make(smaller, process.execPath, own('optimize', path(source), ...options), values.kept))
      await file(`SOG, ours, ${dB} dB`, true, smaller);
  }
  evaluator.destroy();
  return { name: scene, source, splats: cloud.count, shDegree: cloud.shDegree, rows };
}

if (values.help) {
  console.log(USAGE);
  process.exit(0);
}
for (const key of ['data', 'work', 'out']) values[key] = resolve(process.env.INIT_CWD ?? process.cwd(), values[key]);
mkdirSync(values.work, { recursive: true });
const adapter = await requestNodeAdapter({ isTrusted: true });
const device = await adapter.requestDevice(deviceDescriptor(adapter));
await pickInitialVariants(device, { format: 'rgba8unorm' });
const json = join(values.out, 'bytes.json');
const before = existsSync(json) ? JSON.parse(readFileSync(json, 'utf8')).scenes : [];
const scenes = [];
const write = () => {
  const named = new Set(scenes.map(({ name }) => name));
  const report = {
    ...{ kind: 'bytes', date: new Date().toISOString(), views: Number(values.views), rate: RATE },
    scenes: [...before.filter(({ name }) => !named.has(name)), ...scenes],
  };
  writeFileSync(json, `${JSON.stringify(report, null, 2)}\n`);
  writeFileSync(join(values.out, 'bytes.svg'), drawChart(report));
};
for (const name of values.scenes.split(',')) {
  if (!(name in SCENES) || !existsSync(join(values.data, SCENES[name].source))) {
    console.log(`${name}: no such scene in ${values.data}: ${readdirSync(values.data).join(' ')}`);
    continue;
  }
  console.log(name);
  scenes.push(await measure(name, SCENES[name], device));
  write();
}
console.log(json);
process.exit(0);
