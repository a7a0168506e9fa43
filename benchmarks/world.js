/** The page of several scenes in one image: each case is measured in bursts between bursts of what it is compared with. See docs/benchmark.md. */
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { settings } from '@gaussian-splat/renderer';
import { addShadow, cutScenes } from './scene/effects.js';
import { element, showError, showProgress } from './page/show.js';
import { describeEnvironment, openDevice } from './run/environment.js';
import { visit } from './run/measure.js';
import { sendReport } from './run/report.js';
import { summarizeStandard, summarizeVisits } from './run/summary.js';
import { countAllocations, WorldSubject } from './run/world-subject.js';
import { camerasAlong } from './scene/paths.js';
import { placeCopies } from './scene/placement.js';
import { firstSplats, uploadTiled } from './scene/tiling.js';

const MANY = 10;
/** Splats that packed scenes keep together. */
const CHUNK = 256;
/** World units by which the scene that moves is moved in a frame, there and back. */
const STEP = 0.002;
/** Frames until what moves is where it was. */
const THERE_AND_BACK = 40;

/** Pairs to measure, from the page's address. */
function readPlan(query) {
  const whole = (name, usual) => {
    const value = Number(query.get(name) ?? usual);
    if (!Number.isInteger(value) || value < 1) throw new RangeError(`${name}: expected a whole number from 1 on`);
    return value;
  };
  const numbers = { n: 1e6, width: 1920, height: 1080, frames: 80, rounds: 2, warmup: 20 };
  const plan = Object.fromEntries(Object.entries(numbers).map(([name, usual]) => [name, whole(name, usual)]));
  const options = JSON.parse(query.get('options') ?? '{}');
  const only = query.get('only') ?? '';
  return {
    ...{ ...plan, options, only },
    scene: query.get('scene') || '../scenes/skull.spz',
    path: query.get('path') ?? 'among',
  };
}

/** Distributes the copies among a number of scenes, so that their regions overlap. */
const dealt = (copies, scenes) =>
  Array.from({ length: scenes }, (_, k) => copies.filter((_, i) => i % scenes === k)).filter(
    ({ length }) => length > 0,
  );

const moved = (frame) => {
  const phase = frame % THERE_AND_BACK;
  const x = STEP * Math.min(phase, THERE_AND_BACK - phase);
  return [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
};

/** Pairs of subjects to compare. Each creates its two subjects, and reports the scenes that they draw. */
const CASES = [
  { name: 'two scenes', of: 2, beside: 'one scene of as many splats', besideOf: 1 },
  { name: `${MANY} scenes`, of: MANY, beside: 'one scene of as many splats', besideOf: 1 },
  {
    ...{ name: `${MANY} scenes, one moved in each frame`, of: MANY, beside: 'the same, still', besideOf: MANY },
    eachFrame: ({ placements }, frame) => (placements[1].sceneToWorld = moved(frame)),
  },
  {
    ...{ name: `${MANY} scenes, one faded in each frame`, of: MANY, beside: 'the same, still', besideOf: MANY },
    eachFrame: ({ placements }, frame) => (placements[1].opacity = 0.9 + 0.1 * (frame % 2)),
  },
  ...['tint', 'hide'].flatMap((effect) => [
    {
      ...{ name: `a cut with the effect ${effect} that moves in each frame`, of: 1, beside: 'the same, still' },
      ...{ besideOf: 1, effects: { cut: effect, moves: true }, besideEffects: { cut: effect } },
    },
    {
      ...{ name: `a cut with the effect ${effect} that moves in each frame`, of: 1, beside: 'no cut' },
      ...{ besideOf: 1, effects: { cut: effect, moves: true } },
    },
  ]),
  { name: 'a contact shadow', of: 1, beside: 'none', besideOf: 1, effects: { shadow: true } },
];

class Measurement {
  #gpu;
  #plan;
  #uploads = new Map();

  constructor(gpu, plan) {
    this.#gpu = gpu;
    this.#plan = plan;
  }

  async load() {
    const { scene, n, path, width, height, frames } = this.#plan;
    const whole = await readScene(await fetchScene(new URL(scene, location.href).href), { name: scene });
    // Each of the scenes has a copy at least, and copies are whole chunks, so that none loses a splat to how they are dealt out.
    const base = CHUNK * Math.max(1, Math.floor(Math.min(whole.count, n / MANY) / CHUNK));
    this.cloud = firstSplats(whole, base);
    const { radius, copies } = placeCopies({ base, count: base * Math.max(MANY, Math.round(n / base)) });
    this.copies = copies;
    this.radius = radius;
    this.cameras = camerasAlong({ path, width, height, frames, radius });
  }

  /** The splats as a number of scenes, uploaded once. */
  async scenes(count) {
    if (!this.#uploads.has(count)) {
      const each = [];
      for (const copies of dealt(this.copies, count))
        each.push(...(await uploadTiled(this.#gpu.device, this.cloud, copies)));
      this.#uploads.set(count, each);
    }
    return this.#uploads.get(count);
  }

  async subject(count, eachFrame, { cut, moves, shadow } = {}) {
    const { device } = this.#gpu;
    const { width, height, options } = this.#plan;
    const settled = settings('default', options);
    const how = { width, height, settings: settled, eachFrame };
    if (cut)
      how.eachFrame = await cutScenes(device, await this.scenes(count), { effect: cut, moves, radius: this.radius });
    const subject = new WorldSubject(device, await this.scenes(count), how);
    if (shadow) await addShadow(device, subject.world, this.radius);
    return subject;
  }

  async compare({ name, of, beside, besideOf, eachFrame, effects, besideEffects }) {
    const { rounds, warmup } = this.#plan;
    const own = await this.subject(of, eachFrame, effects);
    const standard = await this.subject(besideOf, undefined, besideEffects);
    try {
      for (let i = 0; i < warmup; i++) standard.draw(this.cameras[i % this.cameras.length], false);
      await standard.finish();
      const visits = [];
      for (let round = 0; round < rounds; round++) {
        showProgress(`${name}, round ${round + 1} of ${rounds}`);
        visits.push(await visit(own, this.cameras, { warmUp: warmup, standard }));
      }
      const facts = { own: await own.facts(), standard: await standard.facts() };
      return { name, beside, ...summarizeVisits(visits), standard: summarizeStandard([{ visits }]), facts };
    } finally {
      own.close();
      standard.close();
    }
  }

  /**
   * Time of the frame in which a scene is added or removed, or all are reordered, beside that of the previous frames.
   */
  async changes() {
    showProgress('scenes that come, go and change places');
    const scenes = await this.scenes(MANY);
    const subject = await this.subject(MANY);
    const allocations = countAllocations(this.#gpu.device);
    const { world } = subject;
    const rows = [];
    const timed = async (name, change) => {
      const frames = { before: [], changed: [], after: [] };
      const draw = async (into) => {
        const begun = performance.now();
        if (into === 'changed') await change();
        subject.draw(this.cameras[0], false);
        const cpu = performance.now() - begun;
        await subject.finish();
        frames[into].push({ cpu, wall: performance.now() - begun });
      };
      for (let i = 0; i < 10; i++) await draw('before');
      allocations.take();
      const held = subject.byteLength;
      await draw('changed');
      const allocated = allocations.take();
      const grown = subject.byteLength - held;
      for (let i = 0; i < 10; i++) await draw('after');
      const median = (some) => some.map(({ wall }) => wall).sort((a, b) => a - b)[some.length >> 1];
      const [{ cpu, wall }] = frames.changed;
      rows.push({
        ...{ name, allocated, grown, cpu, wall, before: median(frames.before), after: median(frames.after) },
        allocatedAfter: allocations.take(),
      });
    };
    try {
      const at = world.placements.length - 1;
      for (let round = 0; round < 3; round++) {
        await timed(`the last of ${MANY} is removed`, () => world.remove(world.placements[at]));
        await timed(`one is added to ${MANY - 1}`, () => world.add({ scene: scenes[at] }));
        await timed(`all ${MANY} change places`, () => {
          const all = [...world.placements];
          for (const placement of all) world.remove(placement);
          for (const { scene } of all.reverse()) world.add({ scene });
          // The list follows, for the next round.
          scenes.reverse();
        });
        await timed('one is hidden', () => (world.placements[0].visible = false));
        await timed('one is shown again', () => (world.placements[0].visible = true));
      }
      return { rows, alone: await this.#alone(scenes[at]) };
    } finally {
      allocations.stop();
      subject.close();
    }
  }

  /** Bytes of intermediate buffers of one of the scenes alone. */
  async #alone(scene) {
    const { width, height, options } = this.#plan;
    const how = { width, height, settings: settings('default', options) };
    const subject = new WorldSubject(this.#gpu.device, [scene], how);
    subject.draw(this.cameras[0], false);
    await subject.finish();
    const { byteLength } = subject;
    subject.close();
    return byteLength;
  }
}

const HEAD = ['what', 'beside', 'burst, ms', 'beside', 'ratio of bursts p50 / p95', 'ratio of spans'];

function show(results) {
  const cells = (name, values) =>
    element(
      'tr',
      {},
      values.map((value) => element(name, { textContent: value ?? '' })),
    );
  const rows = results.map(({ name, beside, burst, standard, ratio }) =>
    cells('td', [
      ...[name, beside, burst.p50.toFixed(3), standard.burst.p50.toFixed(3)],
      `${ratio.burst.p50.toFixed(3)} / ${ratio.burst.p95.toFixed(3)}`,
      ratio.span?.p50.toFixed(3),
    ]),
  );
  const table = element('table', {}, [element('thead', {}, [cells('th', HEAD)]), element('tbody', {}, rows)]);
  document.getElementById('results').replaceChildren(table);
}

async function measure(plan) {
  const gpu = await openDevice();
  const measurement = new Measurement(gpu, plan);
  showProgress(`loading ${plan.scene}`);
  await measurement.load();
  const results = [];
  for (const each of CASES.filter(({ name }) => name.includes(plan.only))) {
    results.push(await measurement.compare(each));
    show(results);
  }
  if (results.length === 0) throw new RangeError(`only: expected a part of the name of a case, found "${plan.only}"`);
  const changes = plan.only ? undefined : await measurement.changes();
  const splats = results[0].facts.own.splats;
  return { kind: 'world', plan, splats, environment: describeEnvironment(gpu), results, changes, errors: gpu.errors };
}

async function main() {
  const query = new URLSearchParams(location.search);
  if (location.search.length < 2) return;
  let report;
  try {
    report = await measure(readPlan(query));
    document.getElementById('status').textContent = 'Done.';
    document.getElementById('json').textContent = JSON.stringify(report, null, 2);
    document.getElementById('raw').hidden = false;
  } catch (error) {
    report = { kind: 'world', error: String(error.stack ?? error) };
    showError(error);
  }
  await sendReport(report, query.get('report'));
}

await main();
