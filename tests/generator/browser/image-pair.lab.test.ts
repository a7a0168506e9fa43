/** Two images and the pose between their cameras are one thing: however late each arrives, no run mixes old and new. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, delay, frames, showLoaded, until } from '../../element/browser/support/harness.js';
import { RUNTIME } from './support.js';

GaussianSplatElement.runtimeLocation = RUNTIME;

const runs = { count: 0 };

before(async () => {
  const { InferenceSession } = (await import(`${RUNTIME}ort.jspi.bundle.min.mjs`)) as {
    InferenceSession: { prototype: { run: (...rest: unknown[]) => unknown } };
  };
  const { run } = InferenceSession.prototype;
  InferenceSession.prototype.run = function countingRun(...rest) {
    runs.count++;
    return run.apply(this, rest);
  };
});

async function image(seed: number): Promise<Blob> {
  const canvas = new OffscreenCanvas(16, 12);
  const context = canvas.getContext('2d')!;
  for (let i = 0; i < 48; i++) {
    context.fillStyle = `hsl(${(i * 40 + seed) % 360} 80% 50%)`;
    context.fillRect(2 * (i % 8), 2 * Math.floor(i / 8), 2, 2);
  }
  return canvas.convertToBlob();
}

const poseAt = (x: number): number[] => [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

it('a pair of images and their pose are taken in one run, and an image that fails does not delay the rest', async () => {
  const errors: string[] = [];
  const [first, second] = [await image(0), await image(90)];
  const urls = [first, second].map((blob) => URL.createObjectURL(blob));
  const attributes = { 'control-image': urls[0], 'control-image_2': urls[1] };
  const element = await showLoaded({ src: '/tests/fixtures/families/feed-forward-2.onnx', ...attributes });
  element.addEventListener('generator-error', (event) => errors.push(JSON.stringify((event as CustomEvent).detail)));
  await frames(3);
  const before = runs.count;
  const third = await image(180);
  // Decoded long after the pose is known.
  const decode = createImageBitmap;
  globalThis.createImageBitmap = (async (...given: Parameters<typeof decode>) => {
    await delay(400);
    return decode(...given);
  }) as typeof decode;
  const fourth = URL.createObjectURL(await image(270));
  element.inputValues = { image: third, image_2: fourth, relative_pose: poseAt(-0.3) };
  await until(() => runs.count > before, 'a run');
  globalThis.createImageBitmap = decode;
  await delay(1000);
  assertEqual(runs.count - before, 1, 'runs for a pair and its pose');
  element.inputValues = { image: third, image_2: '/net/status/404', relative_pose: poseAt(-0.2) };
  await until(() => errors.length > 0, 'error of the missing image');
  await until(() => runs.count === before + 2, 'a run with the pose');
  assert(/404/.test(errors[0]), errors[0]);
});
