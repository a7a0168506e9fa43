/**
 * S9. Splats that fill the screen, by the thousand.
 *
 * Who fails: splat-transform #22 and #293 (DXGI_ERROR_DEVICE_HUNG), PlayCanvas #9036 (hang), vello #548: one submission runs longer than the watchdog of
 * the driver allows, and the device is lost.
 *
 * Recipe: asked for 1,000 to 100,000 full-screen splats at 3840 x 2160, each submission at most 250 ms. Run with 100,000 at that size with tiles, and 1,000
 * with quads, which take hours for more on a CPU; times of submissions are recorded and not limited, since a CPU cannot keep 250 ms.
 *
 * Passes: no loss of the device; the image is right, and the same to the byte however it is divided into submissions; tiles are divided automatically, the more the more
 * pairs of splat and bin there may be, quads if the setting `submissions` asks for it; each submission of quads then has its fraction of the fragments.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { deviceWith } from './support/devices.js';
import { compareImage, differingBytes, notFinite, RASTERIZERS, truth, THREADS } from './support/images.js';
import { fullTest, holds, note, sized } from './support/row.js';
import { capture, Renderer } from '../support/renderer.js';

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

/** Splats of about a pixel. */
const specks = (count: number) =>
  cloudOf(
    repeat(count, () => ({
      position: [random.uniform(-1, 1), random.uniform(-0.5, 0.5), random.uniform(0, 1)],
      scale: 0.003,
      opacity: 0.5,
      color: [0.9, 0.5, 0.1],
    })),
  );

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

/** Submissions of a frame of quads that are counted, and the maximum fraction of all fragments that one of them draws. */
const [SLICES, MAX_FRACTION] = [64, 0.03];

/** A new device whose quads add 1 to red for each fragment, and draw only in the passes of a frame that `draws` names. */
async function countingDevice(draws: { nth: number; of: number }): Promise<GPUDevice> {
  const device = await deviceWith([]);
  const code = '@fragment fn fragment() -> @location(0) vec4f { return vec4f(1, 0, 0, 0); }';
  const module = device.createShaderModule({ code });
  const makePipeline = device.createRenderPipeline.bind(device);
  device.createRenderPipeline = (descriptor) => {
    const isOfQuads = descriptor.label?.startsWith('gs.rasterize.quads') && descriptor.fragment;
    return makePipeline(isOfQuads ? { ...descriptor, fragment: { ...isOfQuads, module } } : descriptor);
  };
  const makeEncoder = device.createCommandEncoder.bind(device);
  let passes = 0;
  device.createCommandEncoder = (descriptor) => {
    const encoder = makeEncoder(descriptor);
    const begin = encoder.beginRenderPass.bind(encoder);
    encoder.beginRenderPass = (of) => {
      const pass = begin(of);
      if (of.label === 'gs.rasterize' && passes++ % draws.of !== draws.nth) pass.drawIndexed = () => undefined;
      return pass;
    };
    return encoder;
  };
  return device;
}

test('quads, divided into many submissions, are the same to the byte', async () => {
  const device = await nodeDevice();
  const width = sized(240, 1920);
  const cloud = fullScreen(sized(600, 2_000));
  const camera = cameraAt([0, 0, -1], [0, 0, 0], { width, height: Math.round((width * 9) / 16) });
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const images: Float32Array[] = [];
  for (const submissions of [1, SLICES]) {
    const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'quads', submissions });
    await capture(device, renderer, { gaussians, camera });
    const watch = timeSubmissions(device);
    images.push(await capture(device, renderer, { gaussians, camera }));
    const times = await Promise.all(watch.times);
    watch.stop();
    assert.ok(times.length >= submissions, `${times.length} submissions`);
    const what = `${cloud.count} full-screen splats, ${width} across, in ${submissions}: longest submission`;
    note('S9', what, Math.max(...times), { unit: 'ms' });
    renderer.destroy();
  }
  holds('S9', `${SLICES} submissions against one: differing bytes`, differingBytes(images[0], images[1]), {
    atMost: 0,
    unit: 'bytes',
  });
  gaussians.destroy();
});

test('quads, divided into many submissions, have few fragments in each, and all of them in one', async () => {
  const cloud = fullScreen(600);
  const camera = cameraAt([0, 0, -1], [0, 0, 0], { width: 64, height: 36 });
  const draws = { nth: 0, of: 1 };
  const device = await countingDevice(draws);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const fragments = async (submissions: number, nth: number): Promise<number> => {
    Object.assign(draws, { nth, of: submissions });
    const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'quads', submissions });
    const pixels = await capture(device, renderer, { gaussians, camera });
    renderer.destroy();
    return pixels.reduce((sum, value, i) => (i % 4 === 0 ? sum + value : sum), 0);
  };
  const whole = await fragments(1, 0);
  const slices: number[] = [];
  for (let nth = 0; nth < SLICES; nth++) slices.push(await fragments(SLICES, nth));
  assert.ok(whole > 64 * 36 * 100, `${whole} fragments: the splats fill the screen`);
  assert.equal(
    slices.reduce((sum, count) => sum + count),
    whole,
    'each fragment is drawn once',
  );
  holds('S9', `largest of ${SLICES} submissions, fraction of the fragments`, Math.max(...slices) / whole, {
    atMost: MAX_FRACTION,
    unit: '',
  });
  gaussians.destroy();
  device.destroy();
});

test('tiles, divided into any number of submissions, are the same to the byte', async () => {
  const device = await nodeDevice();
  const cloud = fullScreen(40);
  // Neither whole tiles nor whole bins: 10 x 5 tiles, fewer than the most parts.
  const camera = cameraAt([0, 0, -1], [0, 0, 0], { width: 150, height: 70 });
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  let whole: Float32Array | undefined;
  let differing = 0;
  const counts = sized([1, 3, 7, 256], [1, 2, 3, 4, 5, 6, 7, 11, 49, 50, 51, 64, 256]);
  for (const submissions of counts) {
    const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'tiles', submissions });
    await capture(device, renderer, { gaussians, camera });
    const watch = timeSubmissions(device);
    const pixels = await capture(device, renderer, { gaussians, camera });
    watch.stop();
    // The frame's own, the one before its painting, and two that read back.
    assert.equal(watch.times.length, submissions + (submissions > 1 ? 3 : 2), `submissions of ${submissions}`);
    await Promise.all(watch.times);
    whole ??= pixels;
    differing += differingBytes(whole, pixels);
    renderer.destroy();
  }
  holds('S9', `tiles in ${counts.length} numbers of submissions: differing bytes`, differing, {
    atMost: 0,
    unit: 'bytes',
  });
  gaussians.destroy();
});

test('tiles are divided automatically, more for more work', async () => {
  // A device that knows nothing yet of what painting costs.
  const device = await deviceWith([]);
  const camera = cameraAt([0, 0, -1], [0, 0, 0], { width: 160, height: 96 });
  const found: number[] = [];
  for (const count of sized([1_000, 70_000], [10_000, 100_000, 300_000])) {
    const gaussians = await GaussianBuffers.upload(device, packGaussians(specks(count)));
    const renderer = new Renderer(device, { threads: THREADS, rasterizer: 'tiles' });
    const target = device.createTexture({ size: [160, 96], format: 'rgba8unorm', usage: 0x8 | 0x10 });
    const watch = timeSubmissions(device);
    renderer.render({ gaussians, camera, target });
    watch.stop();
    found.push(watch.times.length);
    note('S9', `${count} small splats, tiles: submissions of the first frame`, watch.times.length, { unit: '' });
    note('S9', `${count} small splats, tiles: longest submission`, Math.max(...(await Promise.all(watch.times))), {
      unit: 'ms',
    });
    renderer.destroy();
    gaussians.destroy();
    target.destroy();
  }
  assert.equal(found[0], 1, 'little work is one submission');
  assert.ok(
    found.every((submissions, i) => i === 0 || submissions > found[i - 1]),
    `${found.join(', ')} submissions`,
  );
  device.destroy();
});

for (const [rasterizer, count, width, height] of [
  ['tiles', 2_000, 640, 360],
  ['quads', 1_000, 3840, 2160],
  ['tiles', 100_000, 3840, 2160],
] as const) {
  const what = `${count} at ${width} x ${height}, ${rasterizer}`;
  fullTest(`every splat fills the screen, ${what}`, async () => {
    const device = await deviceWith([]);
    let isLost = false;
    void device.lost.then(() => (isLost = true));
    const gaussians = await GaussianBuffers.upload(device, packGaussians(fullScreen(count)));
    const submissions = rasterizer === 'quads' ? 64 : 1;
    const renderer = new Renderer(device, { threads: 'serial', rasterizer, submissions });
    const target = device.createTexture({ size: [width, height], format: 'rgba8unorm', usage: 0x8 | 0x10 });
    const camera = cameraAt([0, 0, -1], [0, 0, 0], { width, height });
    // The first has no room for all pairs; the last has the device's maximum.
    for (let frame = 0; frame < 3; frame++) {
      const watch = timeSubmissions(device);
      renderer.render({ gaussians, camera, target });
      watch.stop();
      const times = await Promise.all(watch.times);
      note('S9', `${what}, frame ${frame}: submissions`, times.length, { unit: '' });
      const longest = Math.max(...times.slice(times.length > 1 ? 1 : 0));
      note('S9', `${what}, frame ${frame}: longest submission that paints`, longest, { unit: 'ms' });
      await renderer.isComplete();
    }
    assert.equal(isLost, false, 'the device is there');
    device.destroy();
  });
}
