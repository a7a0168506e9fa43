/**
 * Measures any renderer, ours and others alike.
 * A subject is
 * draw(camera, timed)   draws and submits one frame; `timed` asks for timestamps
 * finish()              promise: the GPU has done all submitted work
 * readTimes?()          promise of the passes [{label, begin, end}] in ms of each timed frame since the last call
 * settle?(camera)       promise: an asynchronous depth order is that of this camera
 */

import { spanOf } from './summary.js';

export const PHASES = ['burst', 'wall', 'gpu'];

/** Timed frames between two readings of timestamps, submitted without waiting for one another. */
const READ_EVERY = 50;
/** Frames that are submitted in a row, the queue drained once behind them. */
const IN_A_ROW = 40;
/** Frames that may be in flight when a GPU is made to work. */
const BUSY_IN_FLIGHT = 16;
/** Number of empty submissions; the fastest is the latency of the wait. */
const EMPTY = 8;
/** Milliseconds of work before a visit measures: GPUs that were idle run at a fraction of their clock. */
const BUSY_MS = 400;

/** Frames of a subject between two turns of the standard, where single frames are timed: short against changes of a GPU's clock. */
const TURN = 10;

/**
 * One visit to a subject: warm-up, then each phase over all cameras. Times in milliseconds.
 * @param how.standard another subject, already warm, that draws the same frames alternately: `ratios` then has the
 * subject's times as ratios to the standard's, a number for each burst, and `standard` the standard's times.
 */
export async function visit(subject, cameras, { warmUp, phases = PHASES, busyMs = BUSY_MS, standard }) {
  for (let i = 0; i < warmUp; i++) await drawAndWait(subject, cameras[i % cameras.length]);
  await keepBusy(subject, cameras, busyMs);
  if (subject.settle) await subject.settle(cameras[0]);
  const none = { own: [], others: [], ratios: [] };
  const time = (kind) => timeBeside(subject, standard, cameras, KINDS[kind]);
  const inRows = phases.includes('burst') ? await time('burst') : none;
  const passes = phases.includes('gpu') && subject.readTimes ? await time('span') : none;
  const alone = phases.includes('wall') ? await time('wall') : none;
  const sorted = phases.includes('wall') && subject.settle ? await time('sortedWall') : none;
  const samples = {
    bursts: inRows.own.map(({ burst }) => burst),
    passes: passes.own,
    wall: wallsOf(alone.own),
    sortedWall: wallsOf(sorted.own),
    cpu: alone.own.map(({ cpu }) => cpu),
    empty: phases.includes('wall') && subject.submitNothing ? [await timeNothing(subject)] : [],
  };
  if (!standard) return samples;
  return {
    ...samples,
    ratios: { burst: inRows.ratios, span: passes.ratios, wall: alone.ratios, sortedWall: sorted.ratios },
    standard: {
      bursts: inRows.others.map(({ burst }) => burst),
      passes: passes.others,
      wall: wallsOf(alone.others),
    },
  };
}

const wallsOf = (frames) => frames.map(({ wall }) => wall);
const mean = (times) => times.reduce((sum, time) => sum + time, 0) / times.length;
const meanWall = (frames) => mean(wallsOf(frames));
const meanSpan = (frames) => mean(frames.map(spanOf).filter((span) => span !== undefined));

/**
 * Timing of a burst of frames of a subject and of the standard beside it. A burst's time per frame is the mean, because
 * an option may save time in most frames and cost time in some.
 */
const KINDS = {
  burst: {
    ofSubject: timeBurst,
    ofStandard: timeBurst,
    mean: (rows) => mean(rows.map(({ burst }) => burst)),
    turn: IN_A_ROW,
  },
  span: { ofSubject: timePasses, ofStandard: timePasses, mean: meanSpan, turn: TURN },
  wall: { ofSubject: timeFrames, ofStandard: timeFrames, mean: meanWall, turn: TURN },
  sortedWall: { ofSubject: timeSortedFrames, ofStandard: timeFrames, mean: meanWall, turn: TURN },
};

/**
 * Bursts of a subject between bursts of a standard, if there is one, so that both see the same clock: a burst's ratio is that to the mean of the
 * standard's bursts before and after it.
 */
async function timeBeside(subject, standard, cameras, { ofSubject, ofStandard, mean, turn }) {
  const [own, others, ratios] = [[], [], []];
  const turnOfStandard = async (some) => {
    const frames = await ofStandard(standard, some);
    others.push(...frames);
    return mean(frames);
  };
  if (!standard || (ofStandard === timePasses && !standard.readTimes))
    return { own: await ofSubject(subject, cameras), others, ratios };
  let before = await turnOfStandard(cameras.slice(0, turn));
  for (let first = 0; first < cameras.length; first += turn) {
    const some = cameras.slice(first, first + turn);
    const frames = await ofSubject(subject, some);
    own.push(...frames);
    const after = await turnOfStandard(some);
    const ratio = mean(frames) / ((before + after) / 2);
    if (Number.isFinite(ratio)) ratios.push(ratio);
    before = after;
  }
  return { own, others, ratios };
}

async function drawAndWait(subject, camera) {
  subject.draw(camera, false);
  await subject.finish();
  await nextTask();
}

/** Draws without a pause until the GPU has worked for a while. */
async function keepBusy(subject, cameras, milliseconds) {
  const until = performance.now() + milliseconds;
  for (let i = 0; performance.now() < until; i++) {
    subject.draw(cameras[i % cameras.length], false);
    if (i % BUSY_IN_FLIGHT === BUSY_IN_FLIGHT - 1) await subject.finish();
    await nextTask();
  }
  await subject.finish();
}

/** Frames one right after the other: waited for one by one, a GPU that they do not fill lowers its clock. */
async function timePasses(subject, cameras) {
  const frames = [];
  for (const [i, camera] of cameras.entries()) {
    subject.draw(camera, true);
    await nextTask();
    if ((i + 1) % READ_EVERY === 0) frames.push(...(await subject.readTimes()));
  }
  frames.push(...(await subject.readTimes()));
  return frames;
}

/** Each frame alone: from the call that draws it until the GPU is done. */
async function timeFrames(subject, cameras) {
  const frames = [];
  for (const camera of cameras) {
    const start = performance.now();
    subject.draw(camera, false);
    const cpu = performance.now() - start;
    await subject.finish();
    frames.push({ cpu, wall: performance.now() - start });
    await nextTask();
  }
  return frames;
}

/** Each frame until it is shown in the order that belongs to its camera: for renderers that sort on the side. */
async function timeSortedFrames(subject, cameras) {
  const frames = [];
  for (const camera of cameras) {
    const start = performance.now();
    subject.draw(camera, false);
    await subject.settle(camera);
    subject.draw(camera, false);
    await subject.finish();
    frames.push({ wall: performance.now() - start });
    await nextTask();
  }
  return frames;
}

/** Milliseconds a frame of many in a row, the queue drained once: what a page that draws without a pause gets. */
async function timeBurst(subject, cameras) {
  const rows = [];
  for (let first = 0; first < cameras.length; first += IN_A_ROW) {
    const row = cameras.slice(first, first + IN_A_ROW);
    await subject.finish();
    const start = performance.now();
    for (const camera of row) subject.draw(camera, false);
    await subject.finish();
    rows.push({ burst: (performance.now() - start) / row.length });
    await nextTask();
  }
  return rows;
}

/** Milliseconds until a submission of nothing is done: part of every `wall`. */
async function timeNothing(subject) {
  let min = Infinity;
  for (let i = 0; i < EMPTY; i++) {
    const start = performance.now();
    subject.submitNothing();
    await subject.finish();
    min = Math.min(min, performance.now() - start);
    await nextTask();
  }
  return min;
}

/**
 * Visits every subject in every round, forwards and backwards in turn, so that a machine that warms up or slows down
 * treats all of them alike. `open` makes a subject; its `close` ends a visit.
 * @returns for each entry its visits, or the error that ended them.
 */
export async function visitInTurns(entries, { rounds, open, onVisit = () => {}, ...how }) {
  const results = entries.map(() => ({ visits: [], facts: undefined, error: undefined }));
  for (let round = 0; round < rounds; round++) {
    const order = [...entries.keys()];
    if (round % 2 === 1) order.reverse();
    for (const i of order) {
      if (results[i].error) continue;
      onVisit(entries[i], round);
      await visitOnce(entries[i], results[i], open, how);
    }
  }
  return results;
}

async function visitOnce(entry, result, open, how) {
  let subject;
  try {
    subject = await open(entry);
    result.visits.push(await visit(subject, entry.cameras, how));
    result.facts = await subject.facts();
  } catch (error) {
    result.error = String(error?.stack ?? error);
  } finally {
    subject?.close();
  }
}

const channel = new MessageChannel();
const waiting = [];
channel.port1.onmessage = () => waiting.shift()();
// Node waits for open ports; a test that imports this must be able to end.
channel.port1.unref?.();

/** Lets workers, timers and messages have their turn, without the 4 ms that timers take. */
export function nextTask() {
  return new Promise((resolve) => {
    waiting.push(resolve);
    channel.port2.postMessage(0);
  });
}
