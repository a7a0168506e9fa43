/** Frame times of one second, for the benchmark of streamed scenes. */
import { within } from '../run/bounded.js';
import { degreesBetween } from './flight-path.js';

/** Seconds that the GPU may take for a frame. */
const FRAME_SECONDS = 20;
/** Milliseconds that a frame may take at 60 a second, and between two frames where one was left out. */
const [FRAME_MS, LATE_MS] = [1000 / 60, 1500 / 60];
/** Number of frames between two checks for missing pages. */
const LOOK = 8;
/** Frames that the GPU may be given before it is done with the first of them: what browsers let a page that draws for a display do. */
const IN_FLIGHT = 2;

const percentile = (values, share) => [...values].sort((a, b) => a - b)[Math.floor(share * (values.length - 1))];

export const rounded = (value) => Math.round(1000 * value) / 1000;

const summary = (values) =>
  values.length === 0
    ? undefined
    : {
        median: rounded(percentile(values, 0.5)),
        p95: rounded(percentile(values, 0.95)),
        worst: rounded(Math.max(...values)),
      };

const shareOver = (values, max) => rounded(values.filter((value) => value > max).length / Math.max(1, values.length));

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

/** Waits until the GPU has drawn what was submitted. */
export const drawn = (device) => within(FRAME_SECONDS, 'the GPU to draw a frame', device.queue.onSubmittedWorkDone());

/** Nothing that is read back is waited for before the second is over. */
export class Second {
  #all;
  #timer;
  #begun = [];
  #walls = [];
  #encoding = [];
  #done = [];
  #passes = [];
  #looks = [];
  #errors = [];
  #bytes = 0;
  /** Degrees a second. */
  #turning = [];
  #camera;
  #before;

  /** @param all with the device, the viewpoint, the scene, the target, `settings` of each frame and the traffic of files */
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
    const { device, viewpoint, scene, target, settings } = this.#all;
    const begun = performance.now();
    viewpoint.draw(camera, { target, timer: this.#timer }, settings);
    this.#encoding.push(performance.now() - begun);
    this.#bytes = Math.max(this.#bytes, scene.byteLength + viewpoint.byteLength);
    if (this.#camera) {
      const seconds = Math.max(1e-3, begun - this.#begun.at(-1)) / 1000;
      this.#turning.push(degreesBetween(this.#camera, camera) / seconds);
    }
    this.#camera = camera;
    this.#errors.push(scene.progress.error);
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
    const { overflow, pairOverflow, budgetError } = looks.at(-1);
    return {
      ...{ second, frames: this.frames, turning: summary(this.#turning) },
      ...{ wall: summary(this.#walls), overFrame: shareOver(this.#walls, FRAME_MS) },
      ...{ interval: summary(intervals), late: shareOver(intervals, LATE_MS), encoding: summary(this.#encoding) },
      ...{ gpu: summary(frames.map(spanOf)), stages: stagesOf(frames) },
      bytes: this.#bytes,
      visible: Math.max(...looks.map((look) => look.visible)),
      pairs: Math.max(...looks.map((look) => look.pairs)),
      ...{ overflow, pairOverflow, budgetError: rounded(budgetError) },
      lacking: { looks: looks.length, lacked: looks.filter((look) => look.overflow + look.pairOverflow > 0).length },
      ...now,
      poolError: rounded(error),
      poolErrors: { ...summary(this.#errors), overPixel: shareOver(this.#errors, 1) },
      uploaded: {
        pages: traffic.pages - this.#before.pages,
        megabytes: rounded((traffic.bytes - this.#before.bytes) / 1e6),
        msPerFrame: rounded((traffic.milliseconds - this.#before.milliseconds) / Math.max(1, this.frames)),
        abandoned: traffic.abandoned - this.#before.abandoned,
      },
      fetched,
    };
  }

  /** Requests the pages that the feedback passes since the last call have found. */
  #look() {
    this.#looks.push(this.#all.viewpoint.stats());
    if (this.#timer) this.#passes.push(this.#timer.read());
  }
}
