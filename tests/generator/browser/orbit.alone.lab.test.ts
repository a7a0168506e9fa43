/** A camera that turns while a generator takes 300 ms a run: frames are drawn at the page's rate, each from one whole run, and the last frame is new. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, atRest, nextEvent, showLoaded } from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { FIXTURES, RUNTIME } from './support.js';

const RUN_MS = 300;
/**
 * Minimum duration and number of frames of a turn, with and without the slow generator alternately: other work on the
 * machine then affects both.
 */
const TURN_MS = 700;
const TURN_FRAMES = 8;

GaussianSplatElement.runtimeLocation = RUNTIME;

/** Frames handed to the screen, and runs. */
const counts = { frames: 0, runs: 0 };
let delayMs = 0;

before(async () => {
  const { getCurrentTexture } = GPUCanvasContext.prototype;
  GPUCanvasContext.prototype.getCurrentTexture = function countingTexture() {
    counts.frames++;
    return getCurrentTexture.call(this);
  };
  const { InferenceSession } = (await import(`${RUNTIME}ort.jspi.bundle.min.mjs`)) as {
    InferenceSession: { prototype: { run: (...rest: unknown[]) => Promise<unknown> } };
  };
  const { run } = InferenceSession.prototype;
  InferenceSession.prototype.run = async function slowRun(...rest) {
    counts.runs++;
    await new Promise((resolve) => setTimeout(resolve, delayMs));
    return run.apply(this, rest);
  };
});

/** Turns the camera in every frame; frames that were drawn, runs that began, and the time that it took, ms. */
async function turn(element: GaussianSplatElement): Promise<{ frames: number; runs: number; ms: number }> {
  const before = { ...counts };
  const start = performance.now();
  const isDone = (): boolean => performance.now() - start > TURN_MS && counts.frames - before.frames >= TURN_FRAMES;
  for (let angle = 0; !isDone(); angle += 2) {
    element.setAttribute('camera-orbit', `${angle}deg 75deg 4m`);
    await new Promise(requestAnimationFrame);
  }
  return { frames: counts.frames - before.frames, runs: counts.runs - before.runs, ms: performance.now() - start };
}

it('turning the camera while a generator takes 300 ms a run draws as many frames as without it', async () => {
  const attributes = { src: `${FIXTURES}packed.onnx`, loop: '', 'interpolation-decay': '0' };
  const element = await showLoaded(attributes);
  const still = { frames: 0, runs: 0, ms: 0 };
  const slow = { frames: 0, runs: 0, ms: 0 };
  const add = (sum: typeof still, part: typeof still): void => {
    sum.frames += part.frames;
    sum.runs += part.runs;
    sum.ms += part.ms;
  };
  // The first frames compile.
  await turn(element);
  for (let i = 0; i < 2; i++) {
    add(still, await turn(element));
    delayMs = RUN_MS;
    await element.play();
    add(slow, await turn(element));
    element.pause();
    delayMs = 0;
    // Its last run.
    await new Promise((resolve) => setTimeout(resolve, 2 * RUN_MS));
  }
  const [without, beside] = [still, slow].map(({ frames, ms }) => (1000 * frames) / ms);
  console.log(
    `${without.toFixed(1)} frames a second without runs, ${beside.toFixed(1)} beside ${slow.runs} runs of ${RUN_MS} ms in ${slow.ms.toFixed(0)} ms`,
  );
  assert(still.runs <= 2, `${still.runs} runs while nothing plays, except for the last one of each time`);
  assert(slow.runs >= 2 && slow.runs <= slow.ms / RUN_MS + 3, `${slow.runs} runs: one at a time, and none without end`);
  assert(beside >= 0.6 * without, `${beside} frames a second beside the generator, ${without} without`);
  // The last request is visible: the same image as from a new element.
  const place = { 'camera-orbit': '30deg 75deg 4m' };
  element.setAttribute('camera-orbit', place['camera-orbit']);
  const seeked = nextEvent(element, 'seeked');
  element.currentTime = 2;
  await seeked;
  // The turn and the seek, one soon after the other, are motion: the full frame follows when both are over.
  await atRest(element);
  const shown = await screenOf(element);
  element.remove();
  const fresh = await showLoaded({ ...attributes, ...place, time: '2' });
  await atRest(fresh);
  assertEqual((await screenOf(fresh)).differences(shown, 4), 0, 'pixels that differ');
}).timeout(60_000);
