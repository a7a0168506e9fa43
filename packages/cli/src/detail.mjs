/**
 * Implementation of `gaussian-splat detail`: reads a scene of any size, builds its levels of detail by cells, and writes
 * them as pages with a manifest.
 */
import { existsSync, mkdirSync, readdirSync, readFileSync, rmdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import { lossesIn } from '@gaussian-splat/optimize';
import {
  codingFor,
  cutPages,
  findPageSteps,
  placesOnGrid,
  DEFAULT_STEPS,
  writePages,
} from '@gaussian-splat/optimize/pages';
import { CommandError, parseSceneOptions, report, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import { CREDIT_OPTIONS, CREDIT_USAGE, creditsWith } from './lib/credits.mjs';
import {
  buildPart,
  finishBuild,
  isUnfinished,
  joinParts,
  middleTree,
  openBuild,
  parseMemory,
  UNFINISHED,
  usualCoding,
  wholeTree,
} from './lib/detail/build.mjs';
import { inputsOf } from './lib/detail/inputs.mjs';
import { deflate, deflateQuickly } from './lib/encoders.mjs';
import { dealViews, parseViews } from './lib/given-views.mjs';
import { obstacleToFolder, writeOnce } from './lib/output-file.mjs';

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
  --memory SIZE   such as 2GB, the most that the command takes; default: half of the machine's. Larger scenes are built in cells, on the disk of FOLDER
  --part I/N      builds one of N parts of the cells, into the same FOLDER, on any machine that sees it; ended parts are not built again
  --join          builds the levels above the parts, and writes detail.json
${CREDIT_USAGE}

SCENE may be a list of files: {"scenes": [{"file": "a.ply", "transform": [16 numbers, column by column]}, ...]}
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
    ...{ memory: text, part: text, join: { type: 'boolean' } },
    ...CREDIT_OPTIONS,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(values.out);
  const scene = resolve(parsed.scene);
  const obstacle = obstacleToFolder(out);
  if (obstacle) throw new UsageError(`--out: ${obstacle}`);
  const isJoined = values.join && existsSync(join(out, 'detail.json'));
  if (existsSync(out) && !isEmpty(out) && !isUnfinished(out) && !isJoined)
    throw new UsageError(`--out: ${values.out} is not empty`);
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
  const isInParts = values.part !== undefined || values.join === true;
  if (values.part !== undefined && values.join) throw new UsageError('expected either --part or --join');
  if (isInParts && values.tile !== undefined) throw new UsageError('--tile: expected without --part and --join');
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
    memory: parseMemory(values.memory),
    part: values.part === undefined ? undefined : parsePart(values.part),
    isJoining: values.join === true,
    isMeasuring: values['min-psnr'] !== undefined,
  };
}

const isEmpty = (folder) => readdirSync(folder).length === 0;

/** Reads I/N. @throws UsageError */
function parsePart(text) {
  const [index, of] = /^(\d+)\/(\d+)$/.exec(text)?.slice(1).map(Number) ?? [];
  if (!(index >= 1 && index <= of && of <= 100_000))
    throw new UsageError(`--part: expected I/N with I from 1 to N, such as 1/4, found "${text}"`);
  return { index, of };
}

/** A device, or undefined with a message if none is available for measuring. */
async function deviceToMeasure() {
  try {
    const { requestNodeDevice } = await import('./lib/node-gpu.mjs');
    const { device } = await requestNodeDevice({ isTrusted: true });
    await pickInitialVariants(device, { format: 'rgba8unorm' });
    return device;
  } catch (error) {
    console.log(`not measured: ${error.message}`);
    return undefined;
  }
}

/**
 * Coding of the files of a scene, and its accuracy, measured in a tree.
 * @param isPart Whether the scene has other trees.
 */
async function measuredCoding({ tree, cloud, minPsnr, scored, views, isPart }) {
  const device = await deviceToMeasure();
  const all = isPart ? undefined : tree;
  if (device === undefined) return { coding: codingFor(DEFAULT_STEPS, all), deflate };
  const { steps, ...found } = await findPageSteps({
    ...{ tree, pages: cutPages(tree), cloud, device, minPsnr, scored, views, deflate: deflateQuickly },
    onStep: (step) => console.log(`  ${step}`),
  });
  return { coding: codingFor(steps, all), deflate, ...found };
}

/** File of an unfinished build with the measured coding of the scene, and its accuracy. */
const CODING = 'coding.json';

/**
 * Returns the function that `buildPart` calls for the coding of a cell. That of several cells is measured in the middle of
 * the scene, by the first part that needs it, if `--min-psnr` asks for it.
 */
function codingOf(build, { minPsnr, scored, given, isMeasuring }) {
  const { cells, folder, spool } = build;
  const isPart = cells.count > 1;
  if (minPsnr === undefined || (isPart && !isMeasuring)) return async () => usualCoding(minPsnr);
  return async (tree, cloud) => {
    if (isPart && existsSync(join(folder, CODING))) return chosenCoding(build, minPsnr);
    const views = given && dealViews(given.views, given.path, spool.turn).dealt;
    const measured = isPart ? middleTree(build) : { tree, cloud };
    const choice = await measuredCoding({ ...measured, minPsnr, scored, views, isPart });
    const { coding, psnr, worstPsnr } = choice;
    // Two GPUs may choose differently.
    writeOnce(join(folder, CODING), JSON.stringify({ coding, psnr, worstPsnr }));
    return isPart ? chosenCoding(build, minPsnr) : choice;
  };
}

/** Returns the coding that the parts of a build have had. */
function chosenCoding({ folder }, minPsnr) {
  const path = join(folder, CODING);
  return existsSync(path) ? { ...JSON.parse(readFileSync(path, 'utf8')), deflate } : usualCoding(minPsnr);
}

/** Writes a scene of one cell several times. @returns The manifest. */
async function writeCopies(build, options) {
  const { columns, rows, spacing } = options;
  const { cells, out, folder } = build;
  const { tree, cloud } = cells.count === 1 ? wholeTree(build) : {};
  if (tree === undefined || tree.levels.length === 1) {
    rmSync(folder, { recursive: true });
    if (isEmpty(out)) rmdirSync(out);
    const expected = tree ? 'a scene of more than 256 splats' : 'a scene that fits into --memory';
    throw new UsageError(`--tile: expected ${expected}, found ${options.scene}`);
  }
  const coded = await codingOf(build, options)(tree, cloud);
  const places = placesOnGrid(columns, rows, spacing ?? 2.5 * tree.bounds.radius);
  const put = (path, file) => writeFileSync(join(out, path), file);
  mkdirSync(join(out, 'pages'), { recursive: true });
  return writePages(tree, { coded, places, put });
}

async function main(options) {
  const { scene, out, degree, geometry, minPsnr, scored, given, columns, rows, memory, part, isJoining } = options;
  const { isMeasuring, credits } = options;
  const inputs = inputsOf(scene);
  if (isJoining && !existsSync(join(out, UNFINISHED))) {
    if (existsSync(join(out, 'detail.json'))) return console.log(`${out}: the parts were joined before`);
    throw new CommandError(`${out}: expected cells of parts, found none. Run the parts first, with the same --out`);
  }
  // Pages without a plan are those of another program.
  if (existsSync(out) && !existsSync(join(out, UNFINISHED)))
    rmSync(join(out, 'pages'), { recursive: true, force: true });
  const start = performance.now();
  const facts = [minPsnr ?? null, scored, given?.views ?? null, isMeasuring];
  const build = await openBuild(out, inputs, { degree, geometry, memory, facts });
  const { cells, spool } = build;
  sayWarnings(scene, spool, lossesIn('detail.json', { ...spool.rule, warnings: spool.warnings }));
  if (cells.count > 1)
    console.log(
      `${spool.count} splats in ${cells.count} cells of ${cells.range(0).end}, for ${gigabytes(memory)} of memory`,
    );
  if (given && cells.count > 1)
    throw new UsageError(
      '--views: expected a scene that fits into --memory, because views are of the whole scene. With --min-psnr alone, a part of it is measured',
    );
  const isTiled = columns * rows > 1;
  let manifest = isTiled ? await writeCopies(build, options) : undefined;
  if (!isTiled && !isJoining) {
    const onCell = (done, all) => cells.count > 1 && console.log(`  ${done} of ${all} cells, ${memoryUsed()}`);
    await buildPart(build, part ?? { index: 1, of: 1 }, { codingOf: codingOf(build, options), onCell });
  }
  if (part) return console.log(`part ${part.index} of ${part.of} in ${seconds(start)} s, ${memoryUsed()}: ${out}`);
  const choice = minPsnr === undefined ? undefined : chosenCoding(build, minPsnr);
  const { attribution, license, ...joined } = manifest ?? joinParts(build, choice);
  manifest = { ...joined, ...creditsWith({ attribution, license }, credits) };
  finishBuild(build, manifest);
  const files = manifest.trees.flatMap((tree) => tree.pages.map(({ file }) => file));
  const bytes = files.reduce((sum, file) => sum + statSync(join(out, file)).size, 0);
  const pages = manifest.instances.reduce((sum, { tree: t }) => sum + manifest.trees[t].pages.length, 0);
  report({ splats: manifest.splats, psnr: choice?.psnr });
  const perSplat = isTiled ? '' : `, ${(bytes / manifest.splats).toFixed(2)} bytes a splat`;
  const unusable = spool.droppedCount > 0 ? `, ${spool.droppedCount} unusable ones of the file left out,` : '';
  console.log(
    `${counted(manifest.splats, 'splat')}${unusable} in ${counted(pages, 'page')} (${counted(files.length, 'file')}, ${(bytes / 1e6).toFixed(1)} MB${perSplat}) ` +
      `in ${seconds(start)} s, ${memoryUsed()}: ${join(out, 'detail.json')}`,
  );
  if (choice?.psnr !== undefined)
    console.log(
      `${choice.psnr.toFixed(2)} dB to ${cells.count > 1 ? 'the middle of the scene' : 'the scene'} in held-out views together, ${choice.worstPsnr.toFixed(2)} dB in the worst`,
    );
  if (choice?.psnr < minPsnr)
    console.log(
      `Expected ${minPsnr} dB: these are the most accurate files that were found. Ask for less, or add --quantized or --exact.`,
    );
}

const gigabytes = (bytes) => `${(bytes / 1e9).toFixed(2)} GB`;
const seconds = (start) => ((performance.now() - start) / 1000).toFixed(1);
/** Returns the peak memory of the process. */
const memoryUsed = () => `${gigabytes(1024 * process.resourceUsage().maxRSS)} of memory at most`;

/** A number with its noun. */
function counted(count, noun) {
  return `${count} ${noun}${count === 1 ? '' : 's'}`;
}

await runCommand(USAGE, parseOptions, main, {
  name: 'detail',
  endings: [''],
  single: ['part', 'join'],
  emptied: [''],
  continues: (folder) => existsSync(folder) && isUnfinished(folder),
});
