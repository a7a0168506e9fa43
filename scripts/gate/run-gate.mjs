/**
 * `npm run lab -- gate`: which files of a trained scene lose nothing that its photographs show. Each file is read, drawn as the cameras of the photographs saw the scene, and held against them; what
 * the trained PLY itself has there is the measure. What takes long to make is kept in --work and taken from there the next time.
 */
import { existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { encodingsFor, viewsBetween } from '@gaussian-splat/optimize';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { checkPython, Gate, LIMITS } from '../../packages/cli/src/lib/gate/gate.mjs';
import { holdOut, readPhotographs } from '../../packages/cli/src/lib/gate/photographs.mjs';
import { countedRows } from '../../packages/cli/src/lib/gate/verdicts.mjs';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { halfTurned, make, own, read, readFolder, timed, TRANSFORM } from '../bytes/files.mjs';
import { root } from '../lib/run.mjs';

const USAGE = `usage: npm run lab -- gate [options]

  --data FOLDER    the captured scenes and their photographs (default ../shared/data)
  --only A,B       of these scenes (default all: those of --data and of the studio)
  --scene NAME=PLY,CAMERAS,IMAGES  another scene: its trained file, cameras.json of the training, and the folder of its
                   photographs, with paths relative to --data. Repeatable. Scenes that are not in --data keep their figures
  --jobs N         files that are generated at a time (default 1)
  --work FOLDER    folder for generated files (default bench-results/gate)
  --out FILE       the figures (default docs/frontier/gate.json)
  --every N        compares every Nth photograph, which trainers hold out (default 8)
  --db A,B         PSNR targets of our SOG and our pages in dB, from the smallest file to the largest (default 40,42,44,46,48,50)
  --kept           uses only the generated files in --work, and makes no others
  --python FILE    a Python with packages/cli/src/lib/gate/requirements.txt (default python3)
`;

/**
 * Views that photographs of a scene do not help with are left out by name. Training held out all images of the studio's
 * scenes: all of them judge, and cameras between them make the files.
 */
const SCENES = {
  skull: {
    source: 'scenes/skull.ply',
    cameras: 'photos/skull/cameras.json',
    images: 'photos/skull/images',
    leftOut: ['44', '45'],
  },
};
for (const name of ['apartment', 'garden', 'hall', 'product'])
  SCENES[name] = {
    source: join(root, `demo/scenes/studio/${name}.spz`),
    cameras: join(root, `tests/fixtures/studio/${name}/views.json`),
    images: join(root, `tests/fixtures/studio/${name}/images`),
    leftOut: [],
    areAllHeldOut: true,
  };

const text = (fallback) => ({ type: 'string', default: fallback });
const { values } = parseArgs({
  options: {
    data: text(join(root, '../shared/data')),
    work: text(join(root, 'bench-results/gate')),
    out: text(join(root, 'docs/frontier/gate.json')),
    only: { type: 'string' },
    scene: { type: 'string', multiple: true, default: [] },
    jobs: text('1'),
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
for (const given of values.scene) {
  const [, name, source, cameras, images] = /^([\w-]+)=([^,]+),([^,]+),([^,]+)$/.exec(given) ?? [];
  if (name === undefined) {
    console.error(`--scene: expected NAME=PLY,CAMERAS,IMAGES, found "${given}"\n\n${USAGE}`);
    process.exit(2);
  }
  SCENES[name] = { source, cameras, images, leftOut: [] };
}

/**
 * Makes the files of a scene, --jobs at a time. Returns those that could be made, the trained PLY first: name, bytes, and
 * how they are read.
 */
async function filesOf(scene, source, cloud, views) {
  const made = (file) => join(values.work, `${scene}.${file}`);
  const file = (name, at, turn = (found) => found) => ({
    ...{ name, bytes: statSync(at).size },
    read: async () => turn(await read(at)),
  });
  const whole = { cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) };
  const ply = source.endsWith('.ply') ? source : made('scene.ply');
  const makers = [
    async () => {
      if (ply !== source) writeFileSync(ply, await encodingsFor(ply)[0].write(whole));
      return file('PLY, float32', ply);
    },
  ];
  for (const encoding of encodingsFor('a.spz', cloud).toReversed()) {
    const bits = /(\d+) bits/.exec(encoding.title)[1];
    makers.push(async () => {
      writeFileSync(made(`${bits}.spz`), await encoding.write(whole));
      return file(`SPZ, ours, harmonics of ${bits} bits`, made(`${bits}.spz`));
    });
  }
  for (const [name, extension] of [
    ['SPZ of splat-transform', 'transform.spz'],
    ['SOG of splat-transform', 'transform.sog'],
  ]) {
    const args = ['--yes', TRANSFORM, '-q', '-w', '-g', 'cpu', source, made(extension)];
    makers.push(async () => {
      if (!(await make(made(extension), 'npx', args, values.kept))) return undefined;
      return file(name, made(extension), extension.endsWith('spz') ? halfTurned : undefined);
    });
  }
  for (const decibels of values.db.split(',')) {
    const sog = made(`own-${decibels}.sog`);
    const options = ['--min-psnr', decibels, '--views', views, '--out', sog];
    makers.push(async () => {
      if (!(await make(sog, process.execPath, own('optimize', source, ...options), values.kept))) return undefined;
      return file(`SOG, ours, ${decibels} dB`, sog);
    });
    const folder = made(`pages-${decibels}`);
    const asked = ['--out', folder, '--min-psnr', decibels, '--views', views];
    makers.push(async () => {
      if (!(await make(folder, process.execPath, own('detail', source, ...asked), values.kept))) return undefined;
      const { bytes } = await readFolder(folder);
      return { name: `pages, ours, ${decibels} dB`, bytes, read: async () => (await readFolder(folder)).cloud };
    });
  }
  const files = [];
  const waiting = makers.entries();
  // Each worker takes the next file from the same iterator.
  const work = async () => {
    for (const [k, maker] of waiting) files[k] = await maker();
  };
  await Promise.all(Array.from({ length: Math.max(1, Number(values.jobs)) }, work));
  return files.filter(Boolean);
}

/** Returns a camera as files of views have it. */
function calibrationOf({ width, height, fx, fy, cx, cy, worldToCamera }) {
  const rows = [0, 4, 8, 12].map((start) => [...worldToCamera].slice(start, start + 4));
  return { width, height, K: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], worldToCamera: rows }; // prettier-ignore
}

async function judge(scene, { source, cameras, images, leftOut, areAllHeldOut }, device) {
  const path = (file) => file && resolve(values.data, file);
  const photographs = readPhotographs(path(cameras), path(images), leftOut);
  const { judging, others } = holdOut(photographs, areAllHeldOut ? 1 : Number(values.every));
  const making = areAllHeldOut
    ? viewsBetween(judging.map(({ camera }) => camera)).map(calibrationOf)
    : others.map(({ calibration }) => calibration);
  // Files are made without the views that judge them.
  const views = join(values.work, `${scene}.views.json`);
  writeFileSync(views, JSON.stringify({ views: making }));
  const cloud = await read(path(source));
  const folder = join(values.work, 'images', scene);
  const gate = new Gate(device, { photographs: judging, python: values.python, folder });
  const rows = [];
  for (const { name, bytes, read } of await filesOf(scene, path(source), cloud, views)) {
    const [decodeMs, found] = await timed(read);
    const { figures, lost, errors, verdict, passes, description } = await gate.judge(found, name);
    const smaller = (rows[0]?.bytes ?? bytes) / bytes;
    rows.push({ name, bytes, smaller, decodeMs, ...figures, lost, errors, verdict, passes, ...encoderOf(name) });
    const size = `${smaller.toFixed(1).padStart(5)} x smaller`;
    console.log(`  ${name.padEnd(32)} ${size}  ${decodeMs.toFixed(0).padStart(5)} ms  ${description}`);
  }
  for (const { name, smaller } of countedRows(rows)) console.log(`  counts: ${name}, ${smaller.toFixed(1)} x smaller`);
  return { name: scene, source, splats: cloud.count, views: judging.map(({ id }) => id), rows };
}

/** Returns the encoder and the precision (dB or bits) of a row, by whose order passes count; empty for other rows. */
function encoderOf(name) {
  const [, encoder, target] = /^(.*, ours).*?(\d+)(?: dB| bits)$/.exec(name) ?? [];
  return encoder === undefined ? {} : { encoder, target: Number(target) };
}

const withoutLpips = checkPython(values.python);
if (withoutLpips) console.log(`LPIPS is not measured: ${withoutLpips}`);
const adapter = await requestNodeAdapter({ isTrusted: true });
const device = await adapter.requestDevice(deviceDescriptor(adapter));
await pickInitialVariants(device, { format: 'rgba8unorm' });
const scenes = existsSync(values.out) ? JSON.parse(readFileSync(values.out, 'utf8')).scenes : [];
for (const [name, scene] of Object.entries(SCENES)) {
  if (values.only !== undefined && !values.only.split(',').includes(name)) continue;
  if (!existsSync(resolve(values.data, scene.source))) {
    console.log(`${name}: not in ${values.data}`);
    continue;
  }
  console.log(name);
  const judged = await judge(name, scene, device);
  const k = scenes.findIndex((other) => other.name === name);
  scenes.splice(k < 0 ? scenes.length : k, k < 0 ? 0 : 1, judged);
  const report = { kind: 'gate', date: new Date().toISOString(), limits: LIMITS, scenes };
  writeFileSync(values.out, `${JSON.stringify(report, null, 2)}\n`);
}
console.log(values.out);
process.exit(0);
