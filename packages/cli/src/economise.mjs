/** Implementation of `gaussian-splat compress`: reads a scene, compresses it, writes it, and reports the result. */
import { existsSync, mkdirSync, readdirSync, statSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { boundsOf, cameraFromCalibration } from '@gaussian-splat/core';
import {
  dealOwnViews,
  dealtViewsOfVisitors,
  economise,
  economiseWithin,
  encodingsFor,
  filesOfZip,
  FIRST_DECIBELS,
  GpuEvaluator,
  isLodIndex,
  MergingEvaluator,
  RefiningEvaluator,
} from '@gaussian-splat/economise';
import { inline } from '@gaussian-splat/economise/parts';
import { from, parseSceneOptions, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import { encodeWebp } from './lib/encoders.mjs';
import { deviceDescriptor } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { isSameFile, obstacleTo, writeWhole } from './lib/output-file.mjs';
import { readJson } from './lib/input-file.mjs';
import { startReading } from './lib/scene-in-parts.mjs';
import { ThreadPool, usualThreads } from './lib/thread-pool.mjs';

const USAGE = `usage: gaussian-splat economise SCENE --min-db DB --out FILE [options]

  --min-db DB     PSNR over covered pixels of the held-out views that the written file must reach
  --max-mb MB     instead of it: the most accurate file of at most this size
  --out FILE      .sog (the smallest, its bits for each attribute chosen by measurement), .glb (a primitive for each degree of spherical harmonics), .spz (up to 40 to 50 dB) or .ply
                  FOLDER/lod-meta.json: streamed SOG, the same in files by level of detail, in an empty folder or one that does not exist yet
  --views FILE    {views: [{width, height, K, worldToCamera}, ...]}: where people will look from; two of
                  ten are held out, one is for the search, in the others and between them splats are scored. Default: 248 views of the subject, 0.5 to 3.2 radii from its
                  middle and up to 67° above and below, 24 of them held out. Errors are measured in excerpts of frames of as many pixels as 1920 x 1080, and of
                  views of a file in those between neighbors, too. Views of over 1600 pixels a side are drawn with these
  --scored N      without --views: views around the subject to score splats in, 24 to 2000 (default 216); the more, the nearer fewer bands of colour come
  --threads N     that share what comes in parts: reading a large PLY, writing a GLB and reading it again, 1 to 64 (default: one for each processor, at most 16)
  --merge         merges splats that look like one, too: more go at the same figure, for several times the seconds
  --refine        fits the splats that stay to pictures of the whole scene, on the GPU, and drops more where that helps
  --report FILE   the figures as JSON, with the seconds that each kind of work took; of reading, those that the GPU's device does not take meanwhile
`;

function parseOptions(args) {
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, {
    'min-db': text,
    'max-mb': text,
    out: text,
    views: text,
    report: text,
    scored: { ...text, default: '216' },
    threads: { ...text, default: String(usualThreads()) },
    merge: { type: 'boolean', default: false },
    refine: { type: 'boolean', default: false },
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  const maxBytes = values['max-mb'] === undefined ? undefined : 1e6 * Number(values['max-mb']);
  if (maxBytes !== undefined && !(maxBytes > 0)) throw new UsageError('--max-mb: expected megabytes, above 0');
  if ((maxBytes === undefined) === (values['min-db'] === undefined))
    throw new UsageError('expected one of --min-db and --max-mb');
  const minDecibels = Number(values['min-db'] ?? FIRST_DECIBELS);
  if (!(minDecibels >= 10 && minDecibels <= 100)) throw new UsageError('--min-db: expected a number from 10 to 100');
  if (values.out === undefined) throw new UsageError('--out is missing');
  const { merge, refine } = values;
  const [scene, out, views, report] = [parsed.scene, values.out, values.views, values.report].map(
    (path) => path && resolve(from, path),
  );
  checkFiles({ scene, out, views, report });
  const scored = Number(values.scored);
  if (!(Number.isInteger(scored) && scored >= 24 && scored <= 2000))
    throw new UsageError(`--scored: expected a whole number from 24 to 2000, found "${values.scored}"`);
  const threads = Number(values.threads);
  if (!(Number.isInteger(threads) && threads >= 1 && threads <= 64))
    throw new UsageError(`--threads: expected a whole number from 1 to 64, found "${values.threads}"`);
  return { scene, out, minDecibels, maxBytes, views, report, scored, threads, merge, refine };
}

/** Checks all paths before the work. */
function checkFiles({ scene, out, views, report }) {
  encodingsFor(out);
  for (const [option, path] of Object.entries({ out, report })) {
    if (path === undefined) continue;
    const other = (file) => new UsageError(`--${option}: expected another file than ${file}, which is never changed`);
    if (isSameFile(path, scene)) throw other('SCENE');
    if (views && isSameFile(path, views)) throw other('that of --views');
    const obstacle = option === 'out' && isLodIndex(path) ? obstacleInFolder(dirname(path)) : obstacleTo(path);
    if (obstacle) throw new UsageError(`--${option}: ${obstacle}`);
  }
  if (report && isSameFile(report, out)) throw new UsageError('--report: expected another file than that of --out');
}

/** Describes why a folder cannot be written, or returns undefined. */
function obstacleInFolder(folder) {
  if (!existsSync(folder)) return obstacleTo(folder);
  if (!statSync(folder).isDirectory()) return `${folder} is no folder`;
  return readdirSync(folder).length > 0
    ? `the folder ${folder} is not empty`
    : obstacleTo(join(folder, 'lod-meta.json'));
}

/** Writes the result: a file, or the folder of a streamed scene, whose index comes last. */
function writeOut(out, bytes) {
  if (!isLodIndex(out)) return writeWhole(out, bytes);
  for (const [path, file] of filesOfZip(bytes)) {
    const target = isLodIndex(path) ? out : join(dirname(out), path);
    mkdirSync(dirname(target), { recursive: true });
    writeWhole(target, file);
  }
}

function parseViews(path) {
  try {
    const views = readJson(path)?.views;
    if (Array.isArray(views)) return views;
  } catch (error) {
    if (!(error instanceof SyntaxError)) throw error;
    throw new UsageError(`--views: ${path} is no JSON: ${error.message}`);
  }
  throw new UsageError(
    `--views: expected {views: [{width, height, K, worldToCamera}, ...]}, found no list "views" in ${path}`,
  );
}

/** Longest side of a view in px, as in training. Larger images take gigabytes, or exceed the GPU's limits. */
const MAX_SIDE = 1600;

/** Reduces the resolution of a view if it is too large. */
function scaledToMaxSide(camera) {
  const share = MAX_SIDE / Math.max(camera.width, camera.height);
  if (share >= 1) return camera;
  const [width, height] = [camera.width, camera.height].map((side) => Math.max(1, Math.round(share * side)));
  const [x, y] = [width / camera.width, height / camera.height];
  return { ...camera, width, height, fx: x * camera.fx, fy: y * camera.fy, cx: x * camera.cx, cy: y * camera.cy };
}

/** undefined without a path. */
function readViews(path) {
  if (path === undefined) return undefined;
  const views = parseViews(path);
  const cameras = views.map((view, k) => cameraFromCalibration(view, `${path}, view ${k}`));
  const drawn = cameras.map(scaledToMaxSide);
  const smaller = drawn.filter((camera, k) => camera !== cameras[k]).length;
  if (smaller > 0) console.log(`views        ${smaller} of ${views.length} in fewer pixels, ${MAX_SIDE} a side`);
  const dealt = dealOwnViews(drawn);
  if (dealt.heldOut.length > 0) return { dealt, range: `of ${path} and between them` };
  throw new UsageError(`--views: expected 8 views or more, found ${views.length}`);
}

/** The most frequent size of the views. */
function sizeOf(views) {
  const counts = new Map();
  for (const { width, height } of views) {
    const size = `${width} x ${height}`;
    counts.set(size, (counts.get(size) ?? 0) + 1);
  }
  return [...counts].sort((a, b) => b[1] - a[1])[0][0];
}

async function openDevice() {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  const { vendor, architecture, device: model, description } = adapter.info;
  const slow = /swiftshader/i.test(description) ? ', which is no GPU: large scenes take long' : '';
  console.log(`adapter      ${[vendor, architecture, model, description].filter(Boolean).join(' ')}${slow}`);
  return device;
}

async function main({
  scene,
  out,
  minDecibels: asked,
  maxBytes,
  views: viewsFile,
  report,
  scored,
  threads,
  merge,
  refine,
}) {
  const begun = performance.now();
  const seconds = () => (performance.now() - begun) / 1000;
  // Its faults are reported before the work.
  const ownViews = readViews(viewsFile);
  // Reading the file and starting the driver run in parallel.
  const pool = threads > 1 ? new ThreadPool(threads) : inline;
  const { cloud: reading } = await startReading(scene, pool);
  reading.catch(() => undefined);
  const device = await openDevice();
  GpuEvaluator.prepare(device);
  const opened = seconds();
  const cloud = await reading;
  sayWarnings(scene, cloud);
  // Unsupported properties of the format are reported before the first image is drawn.
  encodingsFor(out, cloud);
  // Remaining reading time when the device is ready.
  const read = seconds() - opened;
  const { dealt: views, range } = ownViews ?? {
    dealt: dealtViewsOfVisitors(boundsOf(cloud), scored),
    range: '0.5 to 3.2 radii from the middle, up to 67° above and below',
  };
  const say = (step) => console.log(`${seconds().toFixed(1).padStart(6)} s  ${step}`);
  const onScored = (done, all) => say(`scored in ${done} of ${all} views`);
  const measuring = await GpuEvaluator.create(device, cloud, views, { pool, onScored });
  const maxError = 10 ** (-asked / 10) / (refine ? RefiningEvaluator.leftByRefining : 1);
  const merging = { views: views.scored, maxError, pool };
  const cutting = merge ? new MergingEvaluator(measuring, cloud, merging) : measuring;
  const evaluator = refine ? new RefiningEvaluator(cutting, cloud, { device, views: views.scored }) : cutting;
  const prepare = seconds() - read;
  const options = { name: out, evaluator, pool, encodeWebp, onStep: say };
  const { minDecibels, ...result } =
    maxBytes === undefined
      ? { ...(await economise(cloud, { ...options, minDecibels: asked })), minDecibels: asked }
      : await economiseWithin(cloud, maxBytes, options);
  writeOut(out, result.bytes);
  const { splats, coefficients } = result;
  const spent = { read, prepare, ...result.seconds, total: seconds() };
  const share = ({ before, after }) => `${((100 * after) / Math.max(1, before)).toFixed(1)} %`;
  const [oldBytes, newBytes] = [statSync(scene).size, result.bytes.length];
  const times = Object.entries(spent).map(([work, time]) => `${work} ${time.toFixed(2)}`);
  const unusable = cloud.droppedCount > 0 ? `; ${cloud.droppedCount} unusable ones of the file left out` : '';
  console.log(`
asked        ${minDecibels.toFixed(2)} dB
found        ${result.decibels.toFixed(2)} dB in ${result.heldOutViews} held-out views together, ${result.worstDecibels.toFixed(2)} dB in the worst
views        ${range}; excerpts of ${sizeOf(views.heldOut)}, at the scale of 1920 x 1080 pixels
splats       ${splats.after} of ${splats.before} (${share(splats)})${unusable}
SH numbers   ${coefficients.after} of ${coefficients.before} (${share(coefficients)}); splats by degree ${result.degrees.join(', ')}
bytes        ${newBytes} of ${oldBytes} (${share({ before: oldBytes, after: newBytes })}); ${result.encoding}
seconds      ${times.join(', ')}`);
  const judged = { views: range, excerpts: sizeOf(views.heldOut) };
  const figures = { ...result, ...judged, bytes: newBytes, minDecibels, seconds: spent };
  if (report) writeWhole(report, JSON.stringify(figures, null, 2));
}

await runCommand(USAGE, parseOptions, main);
