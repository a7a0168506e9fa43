/** Measures a streamed scene: a flight over it, frame after frame, and how far its picture is from one with more splats. */
import { lookAt } from '@gaussian-splat/core';
import { checkManifest, MemoryLedger, PassTimer, Renderer, StreamedGaussians } from '@gaussian-splat/renderer';
import { Progress, within } from './run/bounded.js';
import { describeEnvironment, openDevice } from './run/environment.js';
import { readPixels } from './run/read-pixels.js';
import { startFetching } from './run/worker-fetch.js';

const query = new URLSearchParams(location.search);
const number = (name, fallback) => Number(query.get(name) ?? fallback);
const [width, height] = [number('width', 960), number('height', 540)];
const [splats, megabytes, seconds] = [number('splats', 1e6), number('megabytes', 256), number('seconds', 20)];
/** Pixels that what is drawn may be displaced, if the budget allows. */
const detail = number('detail', 1);

/** Seconds at the first place of the flight before it begins, reported apart: what a visitor waits through. */
const warm = number('warm', 3);
/** `display`: a frame for each that the display shows, as on any page; `free`: the next as soon as the GPU is done. */
const pace = query.get('pace') ?? 'display';

/** Seconds that a view may take to have all its pages, and after which everything is reported as far as it has come. */
const [settleSeconds, limit] = [number('settle', 5), number('limit', warm + seconds + 60)];
/** Seconds that one file may take. */
const FETCH_SECONDS = 20;
/** Milliseconds that a frame may take at 60 a second, and between two frames where one was left out. */
const [FRAME_MS, LATE_MS] = [1000 / 60, 1500 / 60];
/** Frames between two looks at whether a frame lacked anything. */
const LOOK = 8;

const say = (text) => {
  document.getElementById('status').textContent = text;
};

const progress = new Progress(limit, say);
/** Grows while there is something to measure; what stands in it is reported, whatever happens. */
const report = {
  ...{ width, height, detail, splatBudget: splats, megabytes, warm, seconds, limit, pace },
  ...{ warmUp: [], flight: [], atRest: [] },
};

async function open(device) {
  const url = new URL(query.get('scene'), location.href);
  const fetchFile = startFetching(FETCH_SECONDS);
  const fetched = await progress.wait('the manifest', fetchFile(url, new AbortController().signal));
  const manifest = checkManifest(JSON.parse(new TextDecoder().decode(fetched)), url.href);
  const traffic = { requests: 0, bytes: 0, errors: [] };
  report.fetched = traffic;
  const fetchPage = async (file, signal) => {
    const bytes = await fetchFile(new URL(file, url), signal);
    traffic.requests++;
    traffic.bytes += bytes.byteLength;
    return bytes;
  };
  const onError = (error) => {
    traffic.errors.push(String(error));
    traffic.errors.splice(5);
  };
  const options = { fetchPage, memoryBudget: 1e6 * megabytes, onError };
  const scene = await progress.wait(
    'the pool and the coarsest page',
    StreamedGaussians.open(device, manifest, options),
  );
  return { manifest, scene, traffic };
}

/** Low over the scene, along a curve that turns, now and then up to where all of it is in sight. */
function cameraAt(share, { center, min, max }) {
  const [x, z] = [(max[0] - min[0]) / 2, (max[2] - min[2]) / 2];
  const place = (s) => [
    center[0] + 0.8 * x * Math.sin(2 * Math.PI * s),
    center[1] - 0.05 * x - 0.5 * x * Math.sin(Math.PI * s) ** 8,
    center[2] + 0.8 * z * Math.sin(4 * Math.PI * s),
  ];
  const focal = height;
  return {
    ...{ width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, near: 0.05, far: Infinity },
    worldToCamera: lookAt(
      place(share),
      place(share + 0.02).map((v, axis) => (axis === 1 ? v + 0.02 * x : v)),
      [0, -1, 0],
    ),
  };
}

const percentile = (values, share) => [...values].sort((a, b) => a - b)[Math.floor(share * (values.length - 1))];
const rounded = (value) => Math.round(1000 * value) / 1000;

const summary = (values) =>
  values.length === 0
    ? undefined
    : {
        median: rounded(percentile(values, 0.5)),
        p95: rounded(percentile(values, 0.95)),
        worst: rounded(Math.max(...values)),
      };

const shareOver = (values, most) => rounded(values.filter((value) => value > most).length / Math.max(1, values.length));

/** Milliseconds from the begin of a frame's first pass to the end of its last. */
const spanOf = (passes) => Math.max(...passes.map(({ end }) => end)) - passes[0].begin;

/** Median milliseconds a frame of each kind of pass. */
function stagesOf(frames) {
  const labels = new Set(frames.flatMap((passes) => passes.map(({ label }) => label)));
  const spent = (passes, label) =>
    passes.filter((pass) => pass.label === label).reduce((sum, { begin, end }) => sum + end - begin, 0);
  const median = (label) =>
    rounded(
      percentile(
        frames.map((passes) => spent(passes, label)),
        0.5,
      ),
    );
  return Object.fromEntries([...labels].map((label) => [label, median(label)]));
}

/**
 * Lets the page's other tasks have a turn, as they do between the frames of a display: a loop that only ever waits for the GPU was seen to bring in two pages in two
 * seconds, with eight on their way all the time.
 */
const turn = () => new Promise((resolve) => (pace === 'free' ? setTimeout(resolve) : requestAnimationFrame(resolve)));

/** Waits until the GPU has drawn what was submitted. */
const drawn = (device) => within(FETCH_SECONDS, 'the GPU to draw a frame', device.queue.onSubmittedWorkDone());

/** Frames that the GPU may be given before it is done with the first of them: what browsers let a page that draws for a display do. */
const IN_FLIGHT = 2;

/** What the frames of one second took. Nothing that is read back is waited for before the second is over. */
class Second {
  #all;
  #timer;
  #begun = [];
  #walls = [];
  #encoding = [];
  #done = [];
  #passes = [];
  #looks = [];
  #before;

  constructor(all, timer) {
    this.#all = all;
    this.#timer = timer;
    this.#before = all.scene.traffic;
  }

  get frames() {
    return this.#begun.length;
  }

  /** Draws a frame, and waits until less than {@link IN_FLIGHT} are left to draw. */
  async draw(camera) {
    const { device, renderer, scene, target } = this.#all;
    const begun = performance.now();
    renderer.render({ gaussians: scene, camera, target, detail, splatBudget: splats, timer: this.#timer });
    this.#encoding.push(performance.now() - begun);
    this.#begun.push(begun);
    this.#done.push(drawn(device).then(() => this.#walls.push(performance.now() - begun)));
    if (this.frames % LOOK === 0) this.#look();
    await this.#done.at(-IN_FLIGHT);
  }

  /** A row of the report. */
  async row(second) {
    const { error, ...now } = this.#all.scene.progress;
    const [traffic, fetched] = [
      this.#all.scene.traffic,
      { ...this.#all.traffic, errors: this.#all.traffic.errors.length },
    ];
    this.#look();
    await Promise.all(this.#done);
    const looks = await Promise.all(this.#looks);
    const frames = (await Promise.all(this.#passes)).flat().filter((passes) => passes.length > 0);
    const intervals = this.#begun.slice(1).map((begun, k) => begun - this.#begun[k]);
    const { visible, overflow, pairOverflow, budgetError } = looks.at(-1);
    return {
      ...{ second, frames: this.frames },
      ...{ wall: summary(this.#walls), overFrame: shareOver(this.#walls, FRAME_MS) },
      ...{ interval: summary(intervals), late: shareOver(intervals, LATE_MS), encoding: summary(this.#encoding) },
      ...{ gpu: summary(frames.map(spanOf)), stages: stagesOf(frames) },
      ...{ visible, overflow, pairOverflow, budgetError: rounded(budgetError) },
      lacking: { looks: looks.length, lacked: looks.filter((look) => look.overflow + look.pairOverflow > 0).length },
      ...now,
      poolError: rounded(error),
      uploaded: {
        pages: traffic.pages - this.#before.pages,
        megabytes: rounded((traffic.bytes - this.#before.bytes) / 1e6),
        msPerFrame: rounded((traffic.milliseconds - this.#before.milliseconds) / Math.max(1, this.frames)),
        abandoned: traffic.abandoned - this.#before.abandoned,
      },
      fetched,
    };
  }

  /** Sends for what the GPU knows of the frames since the last look. */
  #look() {
    this.#looks.push(this.#all.renderer.readStatistics());
    if (this.#timer) this.#passes.push(this.#timer.read());
  }
}

/**
 * Draws for so many seconds.
 * @param rows gets a row for each second
 * @param cameraOf gets the share, 0 to 1, of the seconds that have passed
 */
async function fly(all, rows, what, duration, cameraOf) {
  const timer = all.device.features.has('timestamp-query') ? new PassTimer(all.device) : undefined;
  const start = performance.now();
  const pending = [];
  for (let second = 0; second < duration; second++) {
    const current = new Second(all, timer);
    const end = start + 1000 * Math.min(second + 1, duration);
    progress.begin(`second ${second} of the ${what}`);
    // One frame at least, however slow.
    while (performance.now() < end || current.frames === 0) {
      await turn();
      await current.draw(cameraOf(Math.min(1, (performance.now() - start) / 1000 / duration)));
    }
    pending.push(current.row(second).then((row) => rows.push(row)));
    if (progress.left === 0) throw new Error('the time was up');
  }
  await within(FETCH_SECONDS, `what the GPU knows of the ${what}`, Promise.all(pending));
}

/**
 * Draws one view until nothing more comes, or its time is up: a pool that is too small for a view goes on exchanging pages for a while.
 * @returns seconds taken, and pages on their way at the end: 0 if the view has all that it gets
 */
async function settle({ device, renderer, scene, target }, request) {
  const start = performance.now();
  const took = () => (performance.now() - start) / 1000;
  for (let calm = 0; calm < 20 && took() < Math.min(settleSeconds, progress.left);) {
    const { resident } = scene.progress;
    renderer.render({ ...request, gaussians: scene, target });
    await drawn(device);
    await turn();
    calm = scene.progress.resident === resident && scene.progress.coming === 0 ? calm + 1 : 0;
  }
  return { seconds: rounded(took()), coming: scene.progress.coming };
}

/** PSNR over the pixels that either picture covers; `identical` for the same picture twice, `empty` where neither covers any. */
function psnr(a, b) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    if (a[i + 3] === 0 && b[i + 3] === 0) continue;
    for (let k = 0; k < 4; k++) sum += (a[i + k] - b[i + k]) ** 2;
    count += 4;
  }
  if (count === 0) return 'empty';
  return sum === 0 ? 'identical' : rounded(-10 * Math.log10(sum / count));
}

/** Views at rest: the picture within the budget against one of a quarter of the error and no budget. */
async function compare(all, views) {
  for (const share of [0.1, 0.3, 0.5, 0.9]) {
    if (progress.left === 0) throw new Error('the time was up');
    const camera = cameraAt(share, all.manifest.bounds);
    progress.begin(`the view at ${share} of the flight`);
    const settled = await settle(all, { camera, detail, splatBudget: splats });
    const picture = await readPixels(all.device, all.target);
    const { visible, budgetError } = await all.renderer.readStatistics();
    const { resident, error } = all.scene.progress;
    const rest = { resident, poolError: rounded(error) };
    progress.begin(`the view at ${share} of the flight, four times finer`);
    const finerSettled = await settle(all, { camera, detail: detail / 4, splatBudget: 4 * splats });
    const finer = await readPixels(all.device, all.target);
    const more = await all.renderer.readStatistics();
    views.push({
      ...{ share, settled, visible, budgetError: rounded(budgetError), ...rest },
      against: {
        settled: finerSettled,
        visible: more.visible,
        budgetError: rounded(more.budgetError),
        overflow: more.overflow,
        decibels: psnr(picture, finer),
      },
    });
  }
}

async function measure() {
  const environment = await progress.wait('the GPU device', openDevice());
  const { device } = environment;
  report.environment = describeEnvironment(environment);
  report.gpuErrors = environment.errors;
  const { manifest, scene, traffic } = await open(device);
  Object.assign(report, { splats: manifest.splats, pages: scene.progress.total });
  const renderer = new Renderer(device, { detailFade: number('fade', 0.5) });
  report.levers = renderer.levers;
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC | GPUTextureUsage.STORAGE_BINDING;
  const target = device.createTexture({ size: [width, height], format: 'rgba8unorm', usage });
  const all = { device, renderer, scene, manifest, traffic, target };
  const cameraOf = (share) => cameraAt(share, manifest.bounds);
  await fly(all, report.warmUp, 'warm-up', warm, () => cameraOf(0));
  await fly(all, report.flight, 'flight', seconds, cameraOf);
  report.bytes = { scene: scene.byteLength, renderer: renderer.byteLength, ledger: MemoryLedger.of(device).bytes };
  await compare(all, report.atRest);
}

/** The report in the page, for scripts, and to whoever has asked for it. */
async function publish() {
  const text = JSON.stringify(report, null, 1);
  document.getElementById('json').textContent = text;
  document.getElementById('raw').hidden = false;
  globalThis.report = report;
  if (query.has('report')) await fetch(query.get('report'), { method: 'POST', body: text });
}

if (query.has('scene')) {
  const watch = within(limit + 5, 'the page', measure());
  await watch.catch((error) => {
    report.unfinished = `${error.message}; at work on ${progress}`;
    report.stack = error.stack;
  });
  say(report.unfinished ?? 'done');
  await publish();
}
