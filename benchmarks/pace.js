/**
 * The page for frames in motion: elements in a page, steps of the load, and whether they stay within the budget. See
 * docs/benchmark.md.
 */
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { QUALITY_LEVELS } from '../packages/element/dist/dynamic-quality/quality-levels.js';
import { showError, showProgress } from './page/show.js';
import { Burner } from './pace/burner.js';
import { figuresOf, pixelsFor, summarize } from './pace/figures.js';
import { move, rowsOf } from './pace/motion.js';
import { readPlan } from './pace/plan.js';
import { comeToRest } from './pace/rest.js';
import { showSteps } from './pace/show-steps.js';
import { Stage } from './pace/stage.js';
import { writePly } from './peers/ply.js';
import { withDegree } from './scene/degree.js';
import { sendReport } from './run/report.js';
import { quantile } from './run/summary.js';
import { placeCopies } from './scene/placement.js';

/**
 * Seconds of motion at each size that determine the time of the full frame, and the sizes as multiples of the usual
 * sides.
 */
const CALIBRATION_SECONDS = 1;
const CALIBRATION_SIDES = [0.5, 1.5];
/** Names of all levels, the accurate frame first. */
const NAMES = QUALITY_LEVELS.map(({ name }) => name);

/** Address of the scene: that of the file, or of as many splats of copies side by side. */
async function sceneOf({ scene, splats, degree }) {
  const url = new URL(scene, location.href).href;
  if (splats === 0) return url;
  const cloud = withDegree(await readScene(await fetchScene(url), { name: scene }), degree);
  const { copies } = placeCopies({ base: cloud.count, count: splats });
  return URL.createObjectURL(writePly(cloud, copies));
}

/** Milliseconds after a frame's begin, when the elements' work should be done. */
const GAP_BEGINS = 8;

/** The page's other work in a frame: beside the elements', and in the gap after it. */
function work(burner, { stage, plan, now }) {
  burner?.burn(now.burn * stage.elements[0].stats.dynamicQuality.targetMs);
  if (plan.warm > 0) setTimeout(() => burner.burn(plan.warm), GAP_BEGINS);
}

/** Time of the full frame at a size right after motion, because a GPU at rest has another clock. */
async function wholeTimeAt({ stage, plan, motion }, side) {
  stage.resize(side * plan.width, side * plan.height);
  await move(stage, CALIBRATION_SECONDS, motion);
  const { wholeMs } = await comeToRest(stage, { compares: false });
  const { width, height } = stage.state;
  return { pixels: width * height, milliseconds: wholeMs };
}

/** The elements become as large as takes a multiple of the target. */
async function resizeFor(load, bench) {
  const { stage, plan } = bench;
  const known = [];
  for (const side of CALIBRATION_SIDES) known.push(await wholeTimeAt(bench, side));
  const target = stage.elements[0].stats.dynamicQuality.targetMs;
  const max = (plan.most / Math.max(plan.width, plan.height)) ** 2 * plan.width * plan.height;
  return { known, side: Math.sqrt(pixelsFor(load * target, known, max) / (plan.width * plan.height)) };
}

/** Visits to the first size, after which its time is known: GPUs that were idle run slower at first. */
const VISITS = 4;

/** Time of the full frame at first: the median of the last visits. */
async function firstTime(bench) {
  const times = [];
  for (let visit = 0; visit < VISITS; visit++) times.push((await wholeTimeAt(bench, 1)).milliseconds);
  return quantile(times.slice(1), 0.5);
}

/** One step: motion under the load as it was, the step, motion, rest. */
async function measureStep({ what, value }, bench) {
  const { stage, plan, now, motion } = bench;
  const sizes = what === 'load' ? await resizeFor(value, bench) : undefined;
  if (sizes) stage.resize(now.side * plan.width, now.side * plan.height);
  await move(stage, plan.before, motion);
  const side = sizes?.side ?? (what === 'size' ? value : now.side);
  if (what === 'elements') stage.show(value);
  if (what === 'distance') stage.distance = value;
  if (what === 'burn') now.burn = value;
  now.side = side;
  stage.resize(side * plan.width, side * plan.height);
  const rows = await move(stage, plan.seconds, motion);
  const rest = await comeToRest(stage, plan);
  const ofElements = stage.elements.map((_, i) => figuresOf(rowsOf(rows, i), NAMES));
  const { target, ...figures } = summarize(ofElements, rows);
  const frames = rowsOf(rows, 0).map(({ at, span, moving }) => [Math.round(at), span, NAMES.indexOf(moving)]);
  return {
    step: `${what} ${value}`,
    ...stage.state,
    burn: now.burn,
    target,
    load: Number((rest.wholeMs / target).toFixed(3)),
    ...figures,
    ...rest,
    ...(sizes ? { calibration: sizes.known } : {}),
    ...(plan.keepsFrames ? { frames } : {}),
  };
}

async function measure(plan, steps) {
  await customElements.whenDefined('gaussian-splat');
  showProgress('loading');
  const max = Math.max(1, ...plan.steps.filter(({ what }) => what === 'elements').map(({ value }) => value));
  const stage = new Stage(document.getElementById('stage'), await sceneOf(plan), plan, max);
  stage.resize(plan.width, plan.height);
  await stage.load();
  const burns = plan.warm > 0 || plan.steps.some(({ what }) => what === 'burn');
  const burner = burns ? await Burner.open() : undefined;
  const now = { side: 1, burn: 0 };
  const bench = { stage, plan, now, motion: { speed: plan.speed, onFrame: () => work(burner, { stage, plan, now }) } };
  if (plan.budget > 0) stage.frameBudget = plan.budget * (await firstTime(bench));
  for (const step of plan.steps) {
    if (performance.now() > 1000 * plan.limit) break;
    showProgress(`${step.what} ${step.value}`);
    steps.push(await measureStep(step, bench));
    showSteps(steps);
  }
  const left = plan.steps.length - steps.length;
  return { left, splats: stage.elements[0].stats.total, burnerRoundsPerMs: burner?.perMs };
}

const query = new URLSearchParams(location.search);
if (location.search.length > 1) {
  const { userAgent, hardwareConcurrency } = navigator;
  const report = {
    kind: 'pace',
    date: new Date().toISOString(),
    userAgent,
    processors: hardwareConcurrency,
    steps: [],
  };
  try {
    report.plan = readPlan(query);
    const { info } = (await navigator.gpu?.requestAdapter()) ?? {};
    report.adapter = info && { vendor: info.vendor, description: info.description };
    Object.assign(report, await measure(report.plan, report.steps));
    showSteps(report.steps, report);
  } catch (error) {
    // Earlier measurements are reported even if a later one fails.
    report.error = String(error.stack ?? error);
    showError(error);
  }
  await sendReport(report, query.get('report'));
}
