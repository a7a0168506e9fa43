/**
 * `npm run lab:gate`: which files of a trained scene lose nothing that its photographs show. Each file is read, drawn as the cameras of the photographs saw the scene, and held against them; what
 * the trained PLY itself has there is the measure. What takes long to make is kept in --work and taken from there the next time.
 */
import { spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { PNG } from 'pngjs';
import { cameraFromCalibration } from '@gaussian-splat/core';
import { encodingsFor } from '@gaussian-splat/economise';
import {
  capture,
  deviceDescriptor,
  GaussianBuffers,
  packGaussians,
  Viewpoint,
  World,
  pickInitialVariants,
} from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { halfTurned, make, own, read, readFolder, timed, TRANSFORM } from '../bytes/files.mjs';
import { root } from '../lib/run.mjs';

const USAGE = `usage: npm run lab:gate -- [options]

  --data FOLDER    the captured scenes and their photographs (default ../shared/data)
  --work FOLDER    where files that are made are kept (default bench-results/gate)
  --out FILE       the figures (default docs/frontier/gate.json)
  --every N        every so many-th photograph is compared, those that trainers hold out (default 8)
  --db A,B         dB of our SOG and our pages to try, from the smallest file to the largest (default 40,42,44,46,48,50)
  --kept           of what takes long to make only what is in --work
  --python FILE    a Python with scripts/gate/requirements.txt (default python3); LPIPS is measured where it has lpips, too
`;

/** What a file may lose against the photographs, in the mean of the views: the limits of splat-compression-bench, see docs/benchmark.md. */
const LIMITS = { psnr: 0.2, ssim: 0.002, lpips: 0.005 };

/** Views that photographs of a scene do not help with are left out by name. */
const SCENES = {
  skull: {
    source: 'scenes/skull.ply',
    cameras: 'photos/skull/cameras.json',
    images: 'photos/skull/images',
    leftOut: ['44', '45'],
  },
};

const text = (fallback) => ({ type: 'string', default: fallback });
const { values } = parseArgs({
  options: {
    data: text(join(root, '../shared/data')),
    work: text(join(root, 'bench-results/gate')),
    out: text(join(root, 'docs/frontier/gate.json')),
    every: text('8'),
    db: text('40,42,44,46,48,50'),
    python: text('python3'),
    kept: { type: 'boolean' },
    help: { type: 'boolean' },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}
for (const key of ['data', 'work', 'out']) values[key] = resolve(process.env.INIT_CWD ?? process.cwd(), values[key]);
mkdirSync(values.work, { recursive: true });

/** A view of INRIA's cameras.json, which has the camera's place and its axes in the world as columns. */
function cameraOf({ width, height, fx, fy, position, rotation }) {
  const rows = [0, 1, 2].map((axis) => rotation.map((row) => row[axis]));
  const worldToCamera = [
    ...rows.map((row) => [...row, -row.reduce((sum, value, k) => sum + value * position[k], 0)]),
    [0, 0, 0, 1],
  ];
  const K = [
    [fx, 0, width / 2],
    [0, fy, height / 2],
    [0, 0, 1],
  ];
  return { width, height, K, worldToCamera };
}

/** The files of a scene: name, bytes, and how they are read. */
async function* filesOf(scene, source, cloud, views) {
  const made = (file) => join(values.work, `${scene}.${file}`);
  const file = (name, at, turn = (found) => found) => ({
    ...{ name, bytes: statSync(at).size },
    read: async () => turn(await read(at)),
  });
  yield file('PLY, float32', source);
  const whole = { cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) };
  for (const encoding of encodingsFor('a.spz', cloud).toReversed()) {
    const bits = /(\d+) bits/.exec(encoding.title)[1];
    writeFileSync(made(`${bits}.spz`), await encoding.write(whole));
    yield file(`SPZ, ours, harmonics of ${bits} bits`, made(`${bits}.spz`));
  }
  for (const [name, extension] of [
    ['SPZ of splat-transform', 'transform.spz'],
    ['SOG of splat-transform', 'transform.sog'],
  ]) {
    const args = ['--yes', TRANSFORM, '-q', '-w', '-g', 'cpu', source, made(extension)];
    if (make(made(extension), 'npx', args, values.kept))
      yield file(name, made(extension), extension.endsWith('spz') ? halfTurned : undefined);
  }
  for (const decibels of values.db.split(',')) {
    const sog = made(`own-${decibels}.sog`);
    const options = ['--min-db', decibels, '--views', views, '--out', sog];
    if (make(sog, process.execPath, own('economise', source, ...options), values.kept))
      yield file(`SOG, ours, ${decibels} dB`, sog);
    const folder = made(`pages-${decibels}`);
    const asked = ['--out', folder, '--min-db', decibels];
    if (make(folder, process.execPath, own('detail', source, ...asked), values.kept)) {
      const { bytes } = await readFolder(folder);
      yield { name: `pages, ours, ${decibels} dB`, bytes, read: async () => (await readFolder(folder)).cloud };
    }
  }
}

/** Draws a cloud as the cameras see it, over black; answers the paths of the images. */
async function draw(device, cloud, views, name) {
  const folder = join(values.work, 'images', name.replace(/\W+/g, '-'));
  mkdirSync(folder, { recursive: true });
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const world = new World();
  world.add({ scene: gaussians });
  const viewpoint = new Viewpoint(device, world);
  const paths = [];
  try {
    for (const { id, camera } of views) {
      const { width, height } = camera;
      const pixels = await capture(device, viewpoint, { camera, over: [0, 0, 0, 1] });
      const png = new PNG({ width, height });
      for (let k = 0; k < 4 * width * height; k++) png.data[k] = Math.round(255 * Math.min(1, Math.max(0, pixels[k])));
      paths.push(join(folder, `${id}.png`));
      writeFileSync(paths.at(-1), PNG.sync.write(png));
    }
  } finally {
    viewpoint.destroy();
    gaussians.destroy();
  }
  return paths;
}

/** Means of the metrics over the views. */
function measure(paths, photographs) {
  const input = JSON.stringify({ pairs: paths.map((path, k) => [path, photographs[k]]) });
  const script = join(root, 'scripts/gate/metrics.py');
  const { status, stdout, stderr } = spawnSync(values.python, [script], { input, encoding: 'utf8' });
  if (status !== 0)
    throw new Error(`${values.python}: ${stderr.trim().split('\n').at(-1)}; see scripts/gate/requirements.txt`);
  const rows = JSON.parse(stdout);
  const mean = (key) =>
    rows.some((row) => row[key] === null) ? undefined : rows.reduce((sum, row) => sum + row[key], 0) / rows.length;
  return { psnr: mean('psnr'), ssim: mean('ssim'), lpips: mean('lpips') };
}

async function judge(scene, { source, cameras, images, leftOut }, device) {
  const path = (file) => join(values.data, file);
  const all = JSON.parse(readFileSync(path(cameras), 'utf8')).filter(({ img_name }) => !leftOut.includes(img_name));
  const isHeldOut = (_, k) => k % Number(values.every) === 0;
  const views = all
    .filter(isHeldOut)
    .map((view) => ({ id: view.img_name, camera: cameraFromCalibration(cameraOf(view), view.img_name) }));
  const photographs = views.map(({ id }) => path(`${images}/${id}.jpg`));
  // Files are made without the views that judge them.
  const others = join(values.work, `${scene}.views.json`);
  writeFileSync(others, JSON.stringify({ views: all.filter((view, k) => !isHeldOut(view, k)).map(cameraOf) }));
  const cloud = await read(path(source));
  const rows = [];
  for await (const file of filesOf(scene, path(source), cloud, others)) {
    const [decodeMs, found] = await timed(file.read);
    const figures = measure(await draw(device, found, views, `${scene} ${file.name}`), photographs);
    const [whole = { ...figures, bytes: file.bytes }] = rows;
    const lost = {
      psnr: whole.psnr - figures.psnr,
      ssim: whole.ssim - figures.ssim,
      lpips: figures.lpips === undefined ? undefined : figures.lpips - whole.lpips,
    };
    const passes = Object.entries(LIMITS).every(([key, most]) => lost[key] === undefined || lost[key] < most);
    const row = {
      name: file.name,
      bytes: file.bytes,
      smaller: whole.bytes / file.bytes,
      decodeMs,
      ...figures,
      lost,
      passes,
    };
    rows.push(row);
    console.log(
      `  ${passes ? 'passes' : 'fails '} ${file.name.padEnd(32)} ${row.smaller.toFixed(1).padStart(5)} x smaller  ` +
        `${figures.psnr.toFixed(2)} dB (-${lost.psnr.toFixed(3)})  SSIM ${figures.ssim.toFixed(4)} (-${lost.ssim.toFixed(4)})  ` +
        `LPIPS ${lost.lpips === undefined ? 'not measured' : `(+${lost.lpips.toFixed(4)})`}  ${decodeMs.toFixed(0)} ms`,
    );
  }
  return { name: scene, source, splats: cloud.count, views: views.map(({ id }) => id), rows };
}

const adapter = await requestNodeAdapter({ isTrusted: true });
const device = await adapter.requestDevice(deviceDescriptor(adapter));
await pickInitialVariants(device, { format: 'rgba8unorm' });
const scenes = [];
for (const [name, scene] of Object.entries(SCENES)) {
  if (!existsSync(join(values.data, scene.source))) console.log(`${name}: not in ${values.data}`);
  else {
    console.log(name);
    scenes.push(await judge(name, scene, device));
  }
}
writeFileSync(
  values.out,
  `${JSON.stringify({ kind: 'gate', date: new Date().toISOString(), limits: LIMITS, scenes }, null, 2)}\n`,
);
console.log(values.out);
process.exit(0);
