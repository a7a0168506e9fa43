/**
 * The frontier page: accuracy and time of every configuration of scripts/frontier/configurations.mjs on one scene, path and
 * size. All comparing is done here, so that only numbers leave the machine that it runs on. With `images=1` the report
 * has the compared images, too, for metrics that browsers do not compute.
 */
import { configurations as table } from '../scripts/frontier/configurations.mjs';
import { camerasAlong } from './scene/paths.js';
import { showError, showProgress, showResults } from './page/show.js';
import { DEFAULTS, readConfigurations, readRun } from './run/configuration.js';
import { describeEnvironment, openDevice } from './run/environment.js';
import { visit, visitInTurns } from './run/measure.js';
import { sendReport } from './run/report.js';
import { BenchScene } from './run/scenes.js';
import { Subjects } from './run/subjects.js';
import { summarizeStandard, summarizeVisits } from './run/summary.js';
import { compareImages, pngOfCovered, withoutAlpha, worstOf } from './quality/metrics.js';
import { makeReferences } from './quality/reference.js';

const query = new URLSearchParams(location.search);
const hasImages = query.has('images');

/** The table's lines, or those that the address has (`lines`, as JSON), that `only` (a regular expression over names) leaves, on the scene that the address describes. */
async function chosen() {
  const [base] = await readConfigurations(query, () => []);
  const only = new RegExp(query.get('only') ?? '', 'i');
  const common = Object.fromEntries(
    ['scene', 'splats', 'layout', 'visible', 'mode', 'width', 'height', 'path', 'distance'].map((key) => [
      key,
      base[key],
    ]),
  );
  const lines = query.has('lines') ? JSON.parse(query.get('lines')) : table;
  const entries = lines.filter(({ name }) => only.test(name)).map((line) => ({ ...DEFAULTS, ...line, ...common }));
  if (entries.length === 0) throw new RangeError(`only: no configuration's name matches ${only}`);
  return { common, entries };
}

/** Frames of the path over which the compared views are spread: ten seconds. The measured frames are its first ones. */
const PATH_FRAMES = 600;

/**
 * Frames that lead to a compared view, in turns, so that what a renderer keeps from frame to frame shows in it: an orbit turns by 0.477 degrees a frame, and so an order that
 * is kept over 1 or 2 degrees is as old as it gets after 8 or 9 frames, one over 4 degrees after 8.
 */
const LEAD_INS = [9, 8];

/** `count` of the path's cameras, evenly spaced, each with the cameras that lead to it. */
const spread = (cameras, count) =>
  Array.from({ length: count }, (_, i) => {
    const [longest, leadIn] = [Math.max(...LEAD_INS), LEAD_INS[i % LEAD_INS.length]];
    const at = longest + Math.floor((i * (cameras.length - longest)) / count);
    return { camera: cameras[at], before: cameras.slice(at - leadIn, at) };
  });

async function judge(subjects, entry, moments, references) {
  let subject;
  try {
    subject = await subjects.open(entry);
    const [views, images] = [[], []];
    for (const [i, { camera, before }] of moments.entries()) {
      const pixels = await subject.capture(camera, before);
      views.push(compareImages(pixels, references.images[i], camera));
      if (hasImages) images.push(await pngOfCovered(withoutAlpha(pixels), references.images[i], camera));
      const { ignoredOptions = [] } = await subject.facts();
      // An unknown option would publish the default's figures under another name.
      if (ignoredOptions.length > 0)
        return { error: `the renderer has no option ${ignoredOptions.join(', ')}`, ignoredOptions };
    }
    return { quality: worstOf(views), views, ...(hasImages && { images }) };
  } catch (error) {
    return { error: String(error?.stack ?? error) };
  } finally {
    subject?.close();
  }
}

async function collect(run) {
  const gpu = await openDevice();
  const { common, entries } = await chosen();
  showProgress('loading the scene');
  const scene = await BenchScene.load(gpu.device, common);
  const subjects = new Subjects(gpu.device, scene);
  const along = (frames) => camerasAlong({ ...common, frames, radius: scene.radius * common.distance });
  const cameras = along(run.frames);
  const views = spread(along(PATH_FRAMES), Number(query.get('views') ?? 4));
  const kind = query.get('reference') ?? 'auto';
  // Times are measured first, because read-backs of frames let a GPU clock down. Each alternates with the default,
  // because a GPU's clock changes within a run.
  const standard = await subjects.open({ ...DEFAULTS, ...common });
  await visit(standard, cameras, { ...run, phases: [] });
  const measured = await visitInTurns(
    entries.map((entry) => ({ ...entry, cameras })),
    {
      ...run,
      standard,
      open: (entry) => subjects.open(entry),
      onVisit: ({ name }, round) => showProgress(`round ${round + 1} of ${run.rounds}: ${name}`),
    },
  );
  standard.close();
  const references = await makeReferences({
    device: gpu.device,
    scene,
    cameras: views.map(({ camera }) => camera),
    kind,
    onProgress: showProgress,
  });
  const results = [];
  for (const [i, configuration] of entries.entries()) {
    const { visits, facts, error } = measured[i];
    if (error) {
      results.push({ configuration, error });
      continue;
    }
    showProgress(`comparing ${configuration.name}`);
    const judged = await judge(subjects, configuration, views, references);
    results.push({ configuration, ...judged, ...(judged.error ? {} : { ...summarizeVisits(visits), ...facts }) });
  }
  subjects.dispose();
  await scene.destroy();
  const { images, ...reference } = references;
  if (hasImages)
    reference.images = await Promise.all(images.map((image, i) => pngOfCovered(image.color, image, views[i].camera)));
  return {
    kind: 'frontier',
    environment: describeEnvironment(gpu),
    run,
    scene: { ...common, splats: scene.count, antialiased: scene.antialiased, views: images.length },
    reference,
    standard: summarizeStandard(measured),
    results: results.map((result) => ({ ...result, configuration: { ...result.configuration, splats: scene.count } })),
    errors: gpu.errors,
  };
}

const run = readRun(query);
let report;
try {
  report = await collect(run);
  showResults(report.results, report);
} catch (error) {
  report = { kind: 'frontier', run, error: String(error.stack ?? error) };
  showError(error);
}
await sendReport(report, run.report);
