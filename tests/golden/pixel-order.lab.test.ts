/** An order for each pixel (`order: 'pixel'`) against the oracle, which sorts all that reaches a pixel. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians, SceneDepth, settings, Viewpoint, World } from '@gaussian-splat/renderer';
import { orderOn, PixelOrder } from '@gaussian-splat/renderer/stages';
import { AuxiliaryOutputs } from '@gaussian-splat/renderer/tools';
import { renderOracle, renderOracleWorld, toRgba, type Mode } from '../oracle/oracle.js';
import { referenceViews } from '../support/cameras.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness, describeCloseness, renderCloud } from '../support/compare.js';
import { hasSharedData, needsSharedData, sharedFile } from '../support/data.js';
import { isLab } from '../support/extent.js';
import { psnr } from '../support/metrics.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { readTexture } from '../support/read-frame.js';
import { cameraAt, edgeOnDiscs, needles, resized, room } from '../support/scenes.js';
import { countWork } from '../support/work-counters.js';
import { capture, Renderer, type RendererOptions } from '../support/renderer.js';

after(endNodeDevice);

const NARROW = { rasterizer: 'tiles', order: 'pixel' } as const;
const WIDE = { ...NARROW, orderWindow: 32 } as const;
const RULES = { rules: 'gsplat', order: 'pixel' } as const;

/** Big flat splats that cut one another, as the floor and the walls of a room do: at no pixel the order of their centers is right for all. */
function crossing(count: number): GaussianCloud {
  const random = seededRandom(38);
  return cloudOf(
    repeat(count, () => ({
      position: [random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6)],
      scale: [random.uniform(0.3, 0.8), random.uniform(0.3, 0.8), 0.004],
      rotation: random.rotation(),
      opacity: random.uniform(0.2, 0.95),
      color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    })),
  );
}

const view = cameraAt([0.4, -0.5, -3], [0, 0, 0], { width: 96, height: 64 });

/** PSNR in dB for each of some settings. The laboratory also prints the order of centers (docs/accuracy.md). */
async function compare(
  name: string,
  cloud: GaussianCloud,
  camera: Camera,
  settings: readonly RendererOptions[],
  mode: Mode = 'classic',
): Promise<number[]> {
  const byPixel = renderOracle(cloud, camera, { ...RULES, mode });
  if (isLab) {
    const byCenter = renderOracle(cloud, camera, { rules: 'gsplat', mode });
    const decibels = psnr(toRgba(byCenter), toRgba(byPixel), { channels: 4, mask: byPixel.contributors });
    console.log(`${name}, by center ${decibels.toFixed(1)} dB`);
  }
  const found: number[] = [];
  for (const options of settings) {
    const close = closeness(await renderCloud(await anyDevice(), cloud, camera, mode, options), byPixel);
    console.log(describeCloseness(`${name}, window ${options.orderWindow ?? 16}`, close));
    found.push(close.psnr);
  }
  return found;
}

for (const mode of ['classic', 'antialiased'] as const) {
  test(`splats that cut one another, fewer than a window has: ${mode}`, async () => {
    const [found] = await compare(`crossing ${mode}`, crossing(14), view, [NARROW], mode);
    assert.ok(found >= 59, `${found} dB`);
  });
}

test('rays that are all parallel', async () => {
  const camera = { ...view, orthographic: true, fx: 30, fy: 30 };
  const [found] = await compare('crossing, parallel', crossing(14), camera, [NARROW]);
  assert.ok(found >= 59, `${found} dB`);
});

test('where more splats cut one another, a wider window is nearer', async () => {
  const [narrow, wide] = await compare('crossing 60', crossing(60), view, [NARROW, WIDE]);
  assert.ok(wide > narrow, `${narrow} and ${wide} dB`);
});

for (const [make, min] of [
  [needles, 55],
  [edgeOnDiscs, 42],
  [room, 40],
] as const) {
  test(`procedural: ${make.name}`, async () => {
    const { name, cloud, cameras } = make();
    const [found] = await compare(name, cloud, resized(cameras[0], 120), [NARROW]);
    assert.ok(found >= min, `${found} dB`);
  });
}

test('one word a splat, as in large images', async () => {
  const order = orderOn(await anyDevice());
  await order.load();
  const ofSmallImages = order.now;
  order.now = new PixelOrder(await anyDevice(), 0);
  const [flat] = await compare('crossing, keys', crossing(14), view, [NARROW]);
  const [parallel] = await compare('parallel, keys', crossing(14), { ...view, orthographic: true, fx: 30, fy: 30 }, [
    NARROW,
  ]);
  // The window is carried from batch to batch.
  const { cloud, cameras } = needles();
  const [many] = await compare('needles, keys', cloud, resized(cameras[0], 120), [NARROW]);
  order.now = ofSmallImages;
  assert.ok(flat >= 59 && parallel >= 59 && many >= 55, `${flat}, ${parallel} and ${many} dB`);
});

const views = hasSharedData ? referenceViews() : [];
/** The view that needs the widest window; the laboratory draws all of them, in their own size. */
const HARD = ['skull 50'];
for (const { name, file, camera } of views.filter((each) => isLab || HARD.includes(each.name))) {
  test(`captured: ${name}`, { skip: needsSharedData }, async () => {
    const cloud = await readScene(sharedFile(file), { name: file });
    const own = isLab ? camera : resized(camera, 120);
    const [narrow, wide] = await compare(name, cloud, own, [NARROW, WIDE]);
    assert.ok(narrow >= 45 && wide >= 55, `${narrow} and ${wide} dB`);
  });
}

const MOVED = [0.8, 0, 0.6, 0.2, 0, 1, 0, 0.1, -0.6, 0, 0.8, 0, 0, 0, 0, 1] as const;

test('several scenes, one of them faded, before and behind a wall that leans into them', async () => {
  const device = await anyDevice();
  const clouds = [crossing(7), { ...crossing(7), antialiased: true }];
  const scenes = await Promise.all(clouds.map((cloud) => GaussianBuffers.upload(device, packGaussians(cloud))));
  const world = new World();
  world.add({ scene: scenes[0] });
  world.add({ scene: scenes[1], sceneToWorld: [...MOVED], opacity: 0.7 });
  const { width, height } = view;
  // Depths from 2.4 to 3.6 across the image.
  const wall = Float32Array.from({ length: width * height }, (_, i) => 2.4 + (1.2 * (i % width)) / width);
  const texture = device.createTexture({ size: [width, height], format: 'r32float', usage: 0x6 });
  device.queue.writeTexture({ texture }, wall, { bytesPerRow: 4 * width }, [width, height]);
  const out = device.createTexture({ size: [width, height], format: 'r32float', usage: 0x9 });
  const depth = new SceneDepth(device, { host: { texture }, out });
  const viewpoint = new Viewpoint(device, world, { settings: NARROW });
  const pixels = await capture(device, viewpoint, { camera: view, depth });
  const placed = [
    { cloud: clouds[0], mode: 'classic' },
    { cloud: clouds[1], mode: 'antialiased', sceneToWorld: [...MOVED], opacity: 0.7 },
  ] as const;
  const options = { ...RULES, depth: wall };
  const expected = renderOracleWorld(placed, view, options);
  const close = closeness(pixels, expected);
  console.log(describeCloseness('two scenes and a wall', close));
  const { psnr: found } = close;
  // A rounding decides which pixels have a splat that meets the wall.
  assert.ok(found >= 47, `${found} dB`);
  const median = await readTexture(device, out);
  const off = expected.medianDepth.filter((depth, i) => Math.abs(median[i] - depth) > 0.01 * depth).length;
  assert.ok(off < 0.01 * median.length, `${off} of ${median.length} depths differ`);
  assert.ok(expected.medianDepth.some((depth) => depth > 0));
  viewpoint.destroy();
  for (const each of [texture, out, depth, ...scenes]) each.destroy();
});

test('a frame that follows one of its kind allocates and binds nothing new, and dispatches directly', async () => {
  const device = await anyDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(crossing(14)));
  const renderer = new Renderer(device, NARROW);
  const target = device.createTexture({ size: [view.width, view.height], format: 'rgba8unorm', usage: 0x18 });
  const counter = countWork(device);
  const draw = (): void => renderer.render({ gaussians, camera: view, target });
  for (let frame = 0; frame < 3; frame++) {
    draw();
    await renderer.isComplete();
  }
  counter.take();
  draw();
  const { buffersCreated, bytesAllocated, indirectCalls } = counter.take();
  assert.deepEqual([buffersCreated, bytesAllocated, indirectCalls], [0, 0, 0]);
  renderer.destroy();
  gaussians.destroy();
});

test('what does not fit is refused by name', async () => {
  const device = await anyDevice();
  assert.throws(() => settings('default', { rasterizer: 'quads', order: 'pixel' }), {
    code: 'argument/value',
    where: 'FrameSettings.order',
  });
  assert.throws(() => settings('default', { order: 'depth' as never }), { where: 'FrameSettings.order' });
  assert.throws(() => settings('default', { orderWindow: 8 as never }), { where: 'FrameSettings.orderWindow' });
  const viewpoint = new Viewpoint(device, new World(), { settings: { order: 'pixel' } });
  assert.equal(viewpoint.rasterizer, 'tiles');
  const target = device.createTexture({ size: [view.width, view.height], format: 'rgba8unorm', usage: 0x10 });
  assert.throws(() => viewpoint.draw(view, { target, auxiliary: new AuxiliaryOutputs() }), {
    where: 'FrameTarget.auxiliary',
  });
  viewpoint.destroy();
  target.destroy();
});
