/**
 * Implementation of `gaussian-splat detail`: reads a scene, builds its levels of detail, and writes them as pages with
 * a manifest.
 */
import { existsSync, mkdirSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { readScene, toDegree, upright, uprightRotation } from '@gaussian-splat/formats';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { lossesIn } from '@gaussian-splat/optimize';
import {
  buildDetailTree,
  codingFor,
  cutPages,
  findPageSteps,
  placesOnGrid,
  DEFAULT_STEPS,
  writePages,
} from '@gaussian-splat/optimize/pages';
import { parseSceneOptions, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import { CREDIT_OPTIONS, CREDIT_USAGE, credited } from './lib/credits.mjs';
import { deflate, deflateQuickly } from './lib/encoders.mjs';
import { dealViews, parseViews } from './lib/given-views.mjs';
import { obstacleToFolder, writeWhole } from './lib/output-file.mjs';
import { readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat detail SCENE --out FOLDER [options]

  --out FOLDER    an empty folder, one that does not exist yet, or one where a run was ended early: detail.json and pages/, docs/lod-format.md describes them
  --degree D      spherical harmonics up to this degree, 0 to 3; default: those of the scene
  --min-psnr DB   PSNR to SCENE over the covered pixels of held-out views that the finest pages reach, 30 to 60 (default 50): files are as small as that allows
  --views FILE    {views: [{width, height, K, worldToCamera}, ...]}, eight or more: viewpoints of visitors, in place of views around the scene. Rooms need it
  --score-views N views from all directions that measure the visibility of splats, 24 to 2000 (default 216): harmonics that are hardly visible are rounded more
  --quantized     pages as the GPU reads them, not compressed: 66 dB and more, in two to three times the bytes
  --exact         the same with centers, shapes and opacities as float32 keeps them, in three to four times the bytes
  --tile AxB      A times B copies of the scene on a plane, to try large scenes; they share their files
  --spacing LEN   world units between copies; default: 2.5 times the radius of the scene
${CREDIT_USAGE}
`;

function parseOptions(args) {
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, {
    out: text,
    degree: text,
    tile: text,
    spacing: text,
    'min-psnr': text,
    views: text,
    'score-views': text,
    quantized: { type: 'boolean' },
    exact: { type: 'boolean' },
    ...CREDIT_OPTIONS,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(values.out);
  const scene = resolve(parsed.scene);
  if (existsSync(scene) && statSync(scene).isDirectory())
    throw new UsageError(`${parsed.scene} is a folder, not a scene`);
  const obstacle = obstacleToFolder(out);
  if (obstacle) throw new UsageError(`--out: ${obstacle}`);
  if (existsSync(out) && !isEmpty(out) && !isUnfinished(out)) throw new UsageError(`--out: ${values.out} is not empty`);
  const tile = /^([1-9]\d{0,3})x([1-9]\d{0,3})$/.exec(values.tile ?? '1x1');
  if (tile === null) throw new UsageError(`--tile: expected AxB such as 24x24, found "${values.tile}"`);
  const spacing = values.spacing === undefined ? undefined : Number(values.spacing);
  // All coordinates are float32.
  const farthest = Math.fround(Math.max(tile[1], tile[2]) * (spacing ?? 1));
  if (spacing !== undefined && !(spacing > 0 && farthest < Infinity))
    throw new UsageError(`--spacing: expected a length, found "${values.spacing}"`);
  if (!/^[0-3]$/.test(values.degree ?? '3'))
    throw new UsageError(`--degree: expected 0 to 3, found "${values.degree}"`);
  const degree = Number(values.degree ?? 3);
  for (const name of ['min-psnr', 'views', 'score-views'])
    if (values[name] !== undefined && (values.exact || values.quantized))
      throw new UsageError(`--${name}: expected without --quantized and --exact, whose accuracy is fixed`);
  if (spacing !== undefined && values.tile === undefined) throw new UsageError('--spacing: expected with --tile');
  const minPsnr = Number(values['min-psnr'] ?? 50);
  if (!(minPsnr >= 30 && minPsnr <= 60))
    throw new UsageError(`--min-psnr: expected 30 to 60, found "${values['min-psnr']}"`);
  const scored = Number(values['score-views'] ?? 216);
  if (!(Number.isInteger(scored) && scored >= 24 && scored <= 2000))
    throw new UsageError(`--score-views: expected a whole number from 24 to 2000, found "${values['score-views']}"`);
  const views = values.views === undefined ? undefined : resolve(values.views);
  return {
    ...{ scene, out, degree, scored },
    credits: { attribution: values.attribution, license: values.license },
    // The file is read first, so that its faults are reported before the work.
    given: views && { path: views, views: parseViews(views) },
    geometry: values.exact ? undefined : 'quantized',
    minPsnr: values.exact || values.quantized ? undefined : minPsnr,
    columns: Number(tile[1]),
    rows: Number(tile[2]),
    spacing,
  };
}

const isEmpty = (folder) => readdirSync(folder).length === 0;

/** Whether the folder contains an interrupted run: our pages without the manifest, which is written last. */
function isUnfinished(folder) {
  const pages = join(folder, 'pages');
  if (readdirSync(folder).join() !== 'pages' || !statSync(pages).isDirectory()) return false;
  return readdirSync(pages).every((name) => /^(scene|top|part)-\d{5,}\.bin$/.test(name));
}

/** A device, or undefined with a message if none is available for measuring. */
async function deviceToMeasure() {
  try {
    const { requestNodeAdapter } = await import('./lib/node-gpu.mjs');
    const adapter = await requestNodeAdapter({ isTrusted: true });
    const device = await adapter.requestDevice(deviceDescriptor(adapter));
    await pickInitialVariants(device, { format: 'rgba8unorm' });
    return device;
  } catch (error) {
    console.log(`not measured: ${error.message}`);
    return undefined;
  }
}

/** Coding of the files, and its accuracy; undefined for uncompressed files. */
async function chooseCoding({ tree, cloud, minPsnr, scored, views }) {
  if (minPsnr === undefined) return undefined;
  const device = await deviceToMeasure();
  if (device === undefined) return { coding: codingFor(DEFAULT_STEPS, tree), deflate };
  const { steps, ...found } = await findPageSteps({
    ...{ tree, pages: cutPages(tree), cloud, device, minPsnr, scored, views, deflate: deflateQuickly },
    onStep: (step) => console.log(`  ${step}`),
  });
  return { coding: codingFor(steps, tree), deflate, ...found };
}

/**
 * Writes pages first, then their manifest: a folder without one is not a scene. If writing fails, the pages are
 * removed.
 */
function writeFolder(out, tree, coded, places) {
  const pages = join(out, 'pages');
  if (existsSync(out) && isUnfinished(out)) rmSync(pages, { recursive: true });
  mkdirSync(pages, { recursive: true });
  try {
    let bytes = 0;
    const put = (path, file) => {
      writeFileSync(join(out, path), file);
      bytes += file.length;
    };
    const manifest = writePages(tree, { coded, places, put });
    writeWhole(join(out, 'detail.json'), JSON.stringify(manifest));
    return { manifest, bytes };
  } catch (error) {
    rmSync(pages, { recursive: true, force: true });
    throw error;
  }
}

async function main({ scene, out, degree, geometry, minPsnr, scored, given, columns, rows, spacing, credits }) {
  const openFile = (path) => readWhole(join(dirname(scene), path));
  const read = credited(await readScene(await readWhole(scene), { name: scene, openFile }), credits);
  sayWarnings(scene, read, lossesIn('detail.json', read));
  // Pages store no up direction, so the scene is rotated to the default, (0, -1, 0).
  const cloud = upright(toDegree(Math.min(degree, read.shDegree), read));
  const views = given && dealViews(given.views, given.path, uprightRotation(read)).dealt;
  const start = performance.now();
  const tree = buildDetailTree(cloud, { geometry });
  const built = performance.now();
  const isTiled = columns * rows > 1;
  if (isTiled && tree.levels.length === 1) throw new UsageError('--tile: expected a scene of more than 256 splats');
  const places = isTiled ? placesOnGrid(columns, rows, spacing ?? 2.5 * tree.bounds.radius) : undefined;
  const choice = await chooseCoding({ tree, cloud, minPsnr, scored, views });
  const coded = performance.now();
  const { manifest, bytes } = writeFolder(out, tree, choice, places);
  const pages = manifest.instances.reduce((sum, { tree: t }) => sum + manifest.trees[t].pages.length, 0);
  const files = manifest.trees.reduce((sum, t) => sum + t.pages.length, 0);
  const perSplat = isTiled ? '' : `, ${(bytes / manifest.splats).toFixed(2)} bytes a splat`;
  const unusable = cloud.droppedCount > 0 ? `, ${cloud.droppedCount} unusable ones of the file left out,` : '';
  console.log(
    `${manifest.splats} splats${unusable} in ${pages} pages (${files} files, ${(bytes / 1e6).toFixed(1)} MB${perSplat}); levels in ` +
      `${((built - start) / 1000).toFixed(1)} s, pages in ${((performance.now() - coded) / 1000).toFixed(1)} s: ${join(out, 'detail.json')}`,
  );
  if (choice?.psnr !== undefined)
    console.log(
      `${choice.psnr.toFixed(2)} dB to the scene in held-out views together, ${choice.worstPsnr.toFixed(2)} dB in the worst`,
    );
  if (choice?.psnr < minPsnr)
    console.log(
      `Expected ${minPsnr} dB: these are the most accurate files that were found. Ask for less, or add --quantized or --exact.`,
    );
}

await runCommand(USAGE, parseOptions, main);
