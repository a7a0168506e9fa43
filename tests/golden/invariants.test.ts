/** Invariants of the renderer for all scenes: repeatable, hostile-proof, free of steady-state allocation. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import * as shaders from '@gaussian-splat/renderer/stages';
import { renderOracle } from '../oracle/oracle.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness, renderCloud } from '../support/compare.js';
import { psnr } from '../support/metrics.js';
import { isLab, onlyInFull } from '../support/extent.js';
import { endNodeDevice, anyDevice } from '../support/node-device.js';
import { randomSource } from '../support/gpu.js';
import { cameraAt, equalDepthPlane, movedBy, offCenter, resized, room, withHostileSplats } from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

test('the visible splats of a plan are followed by those beyond the capacity: they are copied together', () => {
  const { visible, overflow } = shaders.layouts.Plan.fields;
  assert.equal(overflow.offset, visible.offset + 4);
});

test('every storage texture `image` is declared as the renderer replaces its format', () => {
  const all = Object.values(shaders).filter(
    (shader): shader is typeof shaders.composeStored =>
      typeof shader === 'object' && 'bindings' in shader && 'image' in shader.bindings,
  );
  const stored = all.filter(({ bindings: { image } }) => image.type === 'storage-texture');
  assert.ok(stored.length > 2);
  for (const { name, code, bindings } of stored)
    assert.ok(code.includes(`texture_storage_2d<${bindings.image.format}`), name);
});

const sameBytes = (a: Float32Array, b: Float32Array): boolean =>
  Buffer.compare(
    Buffer.from(a.buffer, a.byteOffset, a.byteLength),
    Buffer.from(b.buffer, b.byteOffset, b.byteLength),
  ) === 0;

/** Part of a cloud, in its order. */
function part(cloud: GaussianCloud, first: number, end: number): GaussianCloud {
  const cut = (array: Float32Array): Float32Array => {
    const size = array.length / cloud.count;
    return array.slice(first * size, end * size);
  };
  const { positions, scales, rotations, opacities, sh } = cloud;
  return {
    ...cloud,
    count: end - first,
    positions: cut(positions),
    scales: cut(scales),
    rotations: cut(rotations),
    opacities: cut(opacities),
    sh: cut(sh),
  };
}

for (const { make, frames } of [
  // Two hundred of them, and turns between, are a row of `npm run lab -- stability`.
  { make: equalDepthPlane, frames: isLab ? 5 : 2 },
  { make: room, frames: isLab ? 8 : 2 },
]) {
  test(`${frames} frames of one view of ${make.name} are the same bytes`, async () => {
    const device = await anyDevice();
    const { cloud, cameras } = make();
    const camera = resized(cameras[0], 120);
    const renderer = new Renderer(device);
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const first = await capture(device, renderer, { gaussians, camera });
    for (let frame = 1; frame < frames; frame++) {
      const next = await capture(device, renderer, { gaussians, camera });
      assert.ok(sameBytes(first, next), `frame ${frame} differs`);
    }
    assert.ok((await renderer.stats()).visible > 1000, 'the scene is visible');
    renderer.destroy();
    gaussians.destroy();
  });
}

test('hostile values in every attribute change nothing and are counted', async () => {
  const device = await anyDevice();
  const { cloud, cameras } = room();
  const hostile = withHostileSplats(cloud);
  const packed = packGaussians(hostile.cloud);
  assert.equal(packed.droppedCount, hostile.bad.length);
  assert.equal(packed.count, cloud.count);
  const camera = resized(cameras[0], 240);
  const clean = await renderCloud(device, cloud, camera, 'classic');
  assert.ok(sameBytes(clean, await renderCloud(device, hostile.cloud, camera, 'classic')));
});

test('an image of no splats is the background', async () => {
  const device = await anyDevice();
  const renderer = new Renderer(device);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloudOf([])));
  const camera = cameraAt([0, 0, -3], [0, 0, 0], { width: 7, height: 5 });
  const pixels = await capture(device, renderer, { gaussians, camera, background: [0.25, 0.5, 0.125, 0.75] });
  for (let i = 0; i < pixels.length; i += 4) assert.deepEqual([...pixels.subarray(i, i + 4)], [0.25, 0.5, 0.125, 0.75]);
  const nothing = { visible: 0, overflow: 0, pairs: 0, pairOverflow: 0, unusable: 0, budgetError: 0, covered: 0 };
  assert.deepEqual(await renderer.stats(), nothing);
});

test('background shines through by transmittance, premultiplied', async () => {
  const device = await anyDevice();
  const { cloud, cameras } = offCenter();
  const renderer = new Renderer(device);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const clear = await capture(device, renderer, { gaussians, camera: cameras[0] });
  const background = [0.2, 0.1, 0.4, 0.5] as const;
  const over = await capture(device, renderer, { gaussians, camera: cameras[0], background });
  for (let i = 0; i < clear.length; i++) {
    const expected = clear[i] + (1 - clear[i - (i % 4) + 3]) * background[i % 4];
    assert.ok(Math.abs(over[i] - expected) < 1e-5, `number ${i}: ${over[i]}, expected ${expected}`);
  }
});

test('a scene in several buffers is the same image as in one', async () => {
  const device = await anyDevice();
  const { cloud, cameras } = room();
  const cuts = [0, 1000, 1257, 20_000, cloud.count];
  const camera = resized(cameras[0], 240);
  const renderer = new Renderer(device);
  const whole = await capture(device, renderer, {
    gaussians: await GaussianBuffers.upload(device, packGaussians(cloud)),
    camera,
  });
  const pieces: GaussianBuffers[] = [];
  for (let i = 1; i < cuts.length; i++) {
    pieces.push(await GaussianBuffers.upload(device, packGaussians(part(cloud, cuts[i - 1], cuts[i]))));
  }
  assert.ok(sameBytes(whole, await capture(device, renderer, { gaussians: pieces, camera })));
});

test('a moving camera allocates nothing, compiles nothing and reads nothing back', async () => {
  const device = await anyDevice();
  const { cloud, cameras } = offCenter();
  const renderer = new Renderer(device);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const target = device.createTexture({ size: [64, 48], format: 'rgba8unorm', usage: 0x10 });
  const view = target.createView();
  const draw = (i: number): void => {
    const camera = { ...resized(cameras[0], 64), height: 48, cx: 32 + i };
    renderer.render({ gaussians, camera, target: view, targetFormat: 'rgba8unorm' });
  };
  draw(0);
  const calls = spyOnAllocations(device);
  for (let i = 1; i <= 10; i++) draw(i);
  calls.stop();
  assert.deepEqual(calls.names, []);
  assert.equal(calls.submits, 10, 'one submit a frame');
});

/** Records every call of a device that allocates, compiles or waits. */
function spyOnAllocations(device: GPUDevice): { names: string[]; submits: number; stop(): void } {
  const record = { names: [] as string[], submits: 0, stop: () => restore.forEach((undo) => undo()) };
  const restore: (() => void)[] = [];
  const replace = (target: object, name: string, note: () => void): void => {
    const original = Reflect.get(target, name) as (...args: unknown[]) => unknown;
    Reflect.set(target, name, function (this: unknown, ...args: unknown[]) {
      note();
      return original.apply(target, args);
    });
    restore.push(() => Reflect.deleteProperty(target, name) || Reflect.set(target, name, original));
  };
  const creators = [
    'Buffer',
    'Texture',
    'BindGroup',
    'BindGroupLayout',
    'PipelineLayout',
    'ShaderModule',
    'Sampler',
    'QuerySet',
  ];
  const pipelines = ['ComputePipeline', 'RenderPipeline', 'ComputePipelineAsync', 'RenderPipelineAsync'];
  for (const name of [...creators, ...pipelines]) replace(device, `create${name}`, () => record.names.push(name));
  replace(device.queue, 'onSubmittedWorkDone', () => record.names.push('onSubmittedWorkDone'));
  replace(device.queue, 'submit', () => record.submits++);
  return record;
}

test('a scene a million units from the origin looks as at the origin', async () => {
  const device = await anyDevice();
  const { cloud, cameras } = offCenter();
  const here = await renderCloud(device, cloud, cameras[0], 'classic');
  // Powers of two, so that the camera's own float64 position loses nothing.
  const moved = movedBy(offCenter(), [2 ** 20, -(2 ** 21), 2 ** 19]);
  const there = await renderCloud(device, moved.cloud, moved.cameras[0], 'classic');
  assert.ok(psnr(here, there, { channels: 4 }) > 75, `${psnr(here, there, { channels: 4 })} dB`);
});

test('more splats with SH3 than a buffer holds at default limits span pages', { skip: onlyInFull }, async () => {
  const device = await anyDevice();
  const visible = 3000;
  const random = randomSource(3);
  const near = cloudOf(
    repeat(visible, () => ({
      position: [random() - 0.5, random() - 0.5, random() - 0.5],
      scale: 0.01 + 0.02 * random(),
      opacity: 0.2 + 0.7 * random(),
      color: [random(), random(), random()],
      sh: Array.from({ length: 45 }, () => 0.2 * (random() - 0.5)),
    })),
    3,
  );
  // The visible ones are spread over the whole file; the others lie behind the camera.
  const few = packGaussians(near);
  const bytes = Math.max(few.geometry.byteLength, few.sh.byteLength) / few.count;
  const packed = spread(few, Math.ceil((1.05 * device.limits.maxStorageBufferBindingSize) / bytes));
  const gaussians = await GaussianBuffers.upload(device, packed);
  assert.equal(gaussians.blocks.length, 2, 'two pages');
  const renderer = new Renderer(device);
  const camera = cameraAt([0, 0, -2], [0, 0, 0], { width: 160, height: 120 });
  const pixels = await capture(device, renderer, { gaussians, camera });
  const close = closeness(pixels, renderOracle(near, camera, { rules: 'gsplat', mode: 'classic' }));
  assert.ok(close.psnr >= 59, `${close.psnr} dB`);
  renderer.destroy();
  gaussians.destroy();
});

/** `packed` spread evenly over `count` splats, the rest far behind. */
function spread(packed: PackedGaussians, count: number): PackedGaussians {
  const [geometryWords, shWords] = [packed.geometry.length / packed.count, packed.sh.length / packed.count];
  const geometry = new Uint32Array(geometryWords * count);
  const sh = new Uint32Array(shWords * count);
  const floats = new Float32Array(geometry.buffer);
  const step = Math.floor(count / packed.count);
  for (let i = 0; i < count; i++) {
    geometry.set(packed.geometry.subarray(0, geometryWords), geometryWords * i);
    floats.set([0, 0, -100], geometryWords * i);
  }
  for (let i = 0; i < packed.count; i++) {
    geometry.set(packed.geometry.subarray(geometryWords * i, geometryWords * (i + 1)), geometryWords * i * step);
    sh.set(packed.sh.subarray(shWords * i, shWords * (i + 1)), shWords * i * step);
  }
  // Every chunk has splats in view and splats behind: bounds of all of them serve for each.
  const bounds = [-1, -1, -100, 1, 1, 1, 1, 0];
  const chunks = Float32Array.from({ length: 8 * Math.ceil(count / 256) }, (_, i) => bounds[i % 8]);
  return { ...packed, count, geometry, sh, chunks };
}

after(endNodeDevice);
