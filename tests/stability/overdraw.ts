/**
 * S9. Splats that fill the screen, by the thousand.
 *
 * Who fails: splat-transform #22 and #293 (DXGI_ERROR_DEVICE_HUNG), PlayCanvas #9036 (hang), vello #548: one submission runs longer than the watchdog of
 * the driver allows, and the device is lost.
 *
 * Passes: no loss of the device; the picture is right; work is handed over in submissions of a bounded share (see docs/stability.md for the share).
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { capture, GaussianBuffers, packGaussians, Renderer } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { compareImage, differingBytes, notFinite, RASTERIZERS, truth, THREADS } from './support/pictures.js';
import { holds, note, sized } from './support/row.js';

const random = seededRandom(9);
const fullScreen = (count: number) =>
  cloudOf(
    repeat(count, () => ({
      position: [random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(0, 3)],
      scale: [random.uniform(3, 9), random.uniform(3, 9), random.uniform(0.01, 1)],
      opacity: random.logUniform(0.01, 0.9),
      color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    })),
  );

for (const rasterizer of RASTERIZERS) {
  test(`every splat fills the screen, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    let isLost = false;
    void device.lost.then(() => (isLost = true));
    const [count, width] =
      rasterizer === 'quads' ? sized([300, 160], [2_000, 1280]) : sized([300, 160], [10_000, 1280]);
    const cloud = fullScreen(count);
    const camera = cameraAt([0, 0, -1], [0, 0, 0], { width, height: (width * 9) / 16 });
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const renderer = new Renderer(device, { threads: THREADS, rasterizer });
    await capture(device, renderer, { gaussians, camera });
    const start = performance.now();
    const pixels = await capture(device, renderer, { gaussians, camera });
    note('S9', `${count} splats over ${width} pixels across, ${rasterizer}: frame`, performance.now() - start, {
      unit: 'ms',
    });
    assert.equal(notFinite(pixels), 0);
    assert.equal(isLost, false, 'the device is there');
    const small = cameraAt([0, 0, -1], [0, 0, 0], { width: 64, height: 36 });
    const close = compareImage(await capture(device, renderer, { gaussians, camera: small }), truth(cloud, small));
    holds('S9', `${count} splats that fill the screen, ${rasterizer}`, close.psnr, {
      atLeast: rasterizer === 'quads' ? 50 : 59,
      unit: 'dB',
    });
    renderer.destroy();
    gaussians.destroy();
  });
}

/** Milliseconds of every submission of a device's queue, from when the one before it was done. */
function timeSubmissions(device: GPUDevice): { readonly times: Promise<number>[]; stop(): void } {
  const { queue } = device;
  const submit = queue.submit.bind(queue);
  const times: Promise<number>[] = [];
  let before: Promise<number> = Promise.resolve(performance.now());
  queue.submit = (commands) => {
    const start = performance.now();
    submit(commands);
    const previous = before;
    const done = queue.onSubmittedWorkDone().then(() => performance.now());
    before = done;
    times.push(Promise.all([previous, done]).then(([earlier, now]) => now - Math.max(earlier, start)));
    return undefined;
  };
  return { times, stop: () => void Reflect.deleteProperty(queue, 'submit') };
}

test('the painting of a frame, divided into many submissions, is the same to the byte, and none is long', async () => {
  const device = await nodeDevice();
  const width = sized(320, 1920);
  const cloud = fullScreen(sized(600, 2_000));
  const camera = cameraAt([0, 0, -1], [0, 0, 0], { width, height: Math.round((width * 9) / 16) });
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const images: Float32Array[] = [];
  const longest: number[] = [];
  for (const submissions of [1, 64]) {
    const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'quads', submissions });
    await capture(device, renderer, { gaussians, camera });
    const watch = timeSubmissions(device);
    images.push(await capture(device, renderer, { gaussians, camera }));
    const times = await Promise.all(watch.times);
    watch.stop();
    longest.push(Math.max(...times));
    assert.ok(times.length >= submissions, `${times.length} submissions`);
    note(
      'S9',
      `${cloud.count} full-screen splats, ${width} across, in ${submissions}: longest submission`,
      longest.at(-1)!,
      { unit: 'ms' },
    );
    renderer.destroy();
  }
  holds('S9', '64 submissions against one: differing bytes', differingBytes(images[0], images[1]), {
    atMost: 0,
    unit: 'bytes',
  });
  holds('S9', 'longest of 64 submissions over the one', longest[1] / longest[0], { atMost: 0.5, unit: 'times' });
  gaussians.destroy();
});
