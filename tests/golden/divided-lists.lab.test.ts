/** Long lists of tiles are divided into segments, which are blended at the same time: images and other outputs are the same. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians, SceneDepth, type FrameTarget } from '@gaussian-splat/renderer';
import { FewTiles, fewTilesOn } from '@gaussian-splat/renderer/stages';
import { AuxiliaryOutputs, readBack } from '@gaussian-splat/renderer/tools';
import { cloudOf, repeat } from '../support/clouds.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { readFrame } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { countWork } from '../support/work-counters.js';
import { Renderer } from '../support/renderer.js';

after(endNodeDevice);

/** Largest difference of a channel: one step of the float16 that is stored, for colors below 1. */
const MAX_DIFFERENCE = 0.13 / 255;
/** Minimum number of splats of a segment, so that a small scene has many of them. */
const SEGMENT_SPLATS = 64;
/** Number of tiles of a bin. */
const TILES = 32;
/** In place of a number of segments: EMPTY_LIST of shaders/shared/divided.wgsl. */
const EMPTY_LIST = 0xffffffff;
const SIZE = { width: 96, height: 64 };
const USAGE = { textureBinding: 4, copySource: 1, copyDestination: 2, storageBinding: 8 };

/** Splats of many opacities, so that pixels end in all segments; the nearest and the farthest are seen by some pixels alone. */
function layered(): GaussianCloud {
  const random = seededRandom(32);
  const splat = (spread: number, size: number, opacity: number) => ({
    position: [random.uniform(-1, 1) * spread, random.uniform(-1, 1) * spread, random.uniform(-0.5, 0.5)] as const,
    scale: [
      random.logUniform(0.3, 1) * size,
      random.logUniform(0.3, 1) * size,
      random.logUniform(0.3, 1) * size,
    ] as const,
    rotation: random.rotation(),
    opacity,
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  });
  return cloudOf([
    ...repeat(8_000, () => splat(0.4, 0.05, random.logUniform(0.03, 0.9))),
    ...repeat(300, () => splat(1, 0.1, random.uniform(0.1, 0.9))),
  ]);
}

const camera: Camera = { ...cameraAt([0, 0, -4], [0, 0, 0], SIZE), fx: 200, fy: 200 };

/** A host's depth with a wall in the left half, in front of half of the splats. */
function wallOn(device: GPUDevice): GPUTexture {
  const texture = device.createTexture({
    size: [SIZE.width, SIZE.height],
    format: 'r32float',
    usage: USAGE.textureBinding | USAGE.copyDestination,
  });
  const depths = Float32Array.from({ length: SIZE.width * SIZE.height }, (_, i) =>
    i % SIZE.width < SIZE.width / 2 ? 4 : 0,
  );
  device.queue.writeTexture({ texture }, depths, { bytesPerRow: 4 * SIZE.width }, [SIZE.width, SIZE.height]);
  return texture;
}

const outputOn = (device: GPUDevice): GPUTexture =>
  device.createTexture({
    size: [SIZE.width, SIZE.height],
    format: 'r32float',
    usage: USAGE.storageBinding | USAGE.copySource,
  });

async function depthsIn(device: GPUDevice, texture: GPUTexture): Promise<Float32Array> {
  const bytesPerRow = 512;
  const buffer = device.createBuffer({ size: bytesPerRow * SIZE.height, usage: 0x9 });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow }, [SIZE.width, SIZE.height]);
  device.queue.submit([encoder.finish()]);
  await buffer.mapAsync(1);
  const values = new Float32Array(buffer.getMappedRange().slice(0));
  buffer.destroy();
  return values;
}

/** Ways to draw a frame, and what they write besides the image. */
const WAYS: Readonly<
  Record<string, (device: GPUDevice) => { target: Partial<FrameTarget>; more?: () => Promise<Float32Array> }>
> = {
  plain: () => ({ target: {} }),
  'auxiliary outputs': (device) => {
    const contributions = device.createBuffer({ size: 4 * 8_448, usage: 0x8c });
    const more = async (): Promise<Float32Array> =>
      new Float32Array((await readBack(device, [{ buffer: contributions }]))[0]);
    return { target: { auxiliary: new AuxiliaryOutputs({ contributions }) }, more };
  },
  'depth of a host and median depth': (device) => {
    const out = outputOn(device);
    const depth = new SceneDepth(device, { host: { texture: wallOn(device), values: 'linear' }, out });
    return { target: { depth }, more: () => depthsIn(device, out) };
  },
  'a layer of color': (device) => {
    const color = device.createTexture({
      size: [SIZE.width, SIZE.height],
      format: 'rgba8unorm',
      usage: USAGE.textureBinding | USAGE.copyDestination,
    });
    const pixels = new Uint8Array(4 * SIZE.width * SIZE.height).fill(100);
    device.queue.writeTexture({ texture: color }, pixels, { bytesPerRow: 4 * SIZE.width }, [SIZE.width, SIZE.height]);
    return {
      target: { depth: new SceneDepth(device, { host: { texture: wallOn(device), values: 'linear', color } }) },
    };
  },
};

/** A device whose buffer of divided lists can be read: the number of segments, and that of each tile of the one bin. */
function readable(device: GPUDevice): { device: GPUDevice; segmentsIn: () => Promise<number[]> } {
  let order: GPUBuffer | undefined;
  const createBuffer = (descriptor: GPUBufferDescriptor): GPUBuffer => {
    const isOrder = descriptor.label === 'gs.bin.order';
    const buffer = device.createBuffer(isOrder ? { ...descriptor, usage: descriptor.usage | 4 } : descriptor);
    if (isOrder) order = buffer;
    return buffer;
  };
  const segmentsIn = async (): Promise<number[]> => {
    // One bin, the number of long bins, the pairs of the longest, the numbers of segments and of divided lists, the tiles.
    const [words] = await readBack(device, [{ buffer: order!, byteOffset: 12, byteLength: 4 * (2 + TILES) }]);
    const [all, , ...tiles] = new Uint32Array(words);
    return [all, ...tiles];
  };
  const other = new Proxy(device, {
    get(target, name) {
      if (name === 'createBuffer') return createBuffer;
      const value: unknown = Reflect.get(target, name, target);
      return typeof value === 'function' ? (value.bind(target) as unknown) : value;
    },
  });
  return { device: other, segmentsIn };
}

for (const [way, make] of Object.entries(WAYS)) {
  test(`${way}: lists in segments give what whole lists give, in the first frame and with known ends`, async () => {
    const { device, segmentsIn } = readable(await nodeDevice());
    const few = fewTilesOn(device);
    few.load = () => undefined;
    few.now = undefined;
    const gaussians = await GaussianBuffers.upload(device, packGaussians(layered()));
    const renderer = new Renderer(device, { rasterizer: 'tiles', threads: 'parallel' });
    const draw = async (): Promise<{ image: Float32Array; more: Float32Array }> => {
      const { target, more } = make(device);
      const image = await readFrame(device, renderer, { gaussians, camera, ...target });
      return { image, more: (await more?.()) ?? new Float32Array() };
    };
    const whole = await draw();
    few.now = new FewTiles(device, SEGMENT_SPLATS);
    const counts: number[] = [];
    for (const frame of ['first', 'second']) {
      const divided = await draw();
      if (way !== 'a layer of color') counts.push((await segmentsIn())[0]);
      const worst = largest(whole.image, divided.image);
      const different = whole.more.filter(
        (value, i) => Math.abs(value - divided.more[i]) > 1e-4 * Math.abs(value) + 1e-6,
      );
      console.log(`${way}, ${frame}: ${255 * worst}/255 at most, ${different.length} of ${whole.more.length} others`);
      assert.ok(worst > 0 || way === 'a layer of color', 'the same sums in another order are not the same bits');
      assert.ok(worst <= MAX_DIFFERENCE, `a pixel differs by ${worst}`);
      // A pixel may end, or become half transparent, one splat earlier.
      assert.ok(different.length <= 2e-3 * whole.more.length, `${different.length} other values differ`);
    }
    console.log(`${way}: ${counts.join(', then ')} segments`);
    if (way !== 'a layer of color') assert.ok(counts[1] > 10 && counts[1] < counts[0], 'segments end with their tile');
    renderer.destroy();
    gaussians.destroy();
  });
}

test('a tile of few splats is divided where its bin has many pairs; one without splats searches for none', async () => {
  const { device, segmentsIn } = readable(await nodeDevice());
  const few = fewTilesOn(device);
  few.load = () => undefined;
  few.now = undefined;
  const random = seededRandom(33);
  const at = (x: number) => ({
    position: [x + random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), random.uniform(-0.5, 0.5)] as const,
    scale: [0.01, 0.01, 0.01] as const,
    opacity: 0.02,
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  });
  // The first column of tiles has thousands of splats, the fifth twenty, and the others none.
  const cloud = cloudOf([...repeat(8_000, () => at(-0.8)), ...repeat(20, () => at(0.48))]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { rasterizer: 'tiles', threads: 'parallel' });
  const whole = await readFrame(device, renderer, { gaussians, camera });
  few.now = new FewTiles(device, SEGMENT_SPLATS);
  const divided = await readFrame(device, renderer, { gaussians, camera });
  const [, ...tiles] = await segmentsIn();
  const row = tiles.slice(8, 14);
  console.log(`a row of tiles: ${row.join(', ')} segments`);
  assert.ok(row[0] > 16 && row[4] >= 4 && row[4] < 16, `${row[0]} and ${row[4]} segments`);
  assert.deepEqual([row[2], row[5]], [EMPTY_LIST, EMPTY_LIST]);
  assert.ok(largest(whole, divided) <= MAX_DIFFERENCE, `a pixel differs by ${largest(whole, divided)}`);
  renderer.destroy();
  gaussians.destroy();
});

test('tiles of 8 x 8 pixels give what those of 16 x 16 give', async () => {
  const device = await nodeDevice();
  const counter = countWork(device);
  const few = fewTilesOn(device);
  few.load = () => undefined;
  const gaussians = await GaussianBuffers.upload(device, packGaussians(layered()));
  const renderer = new Renderer(device, { rasterizer: 'tiles', threads: 'parallel' });
  const draw = async (veryLongPairs: number): Promise<{ image: Float32Array; workgroups: number }> => {
    few.now = new FewTiles(device, SEGMENT_SPLATS, veryLongPairs);
    counter.take();
    const image = await readFrame(device, renderer, { gaussians, camera });
    return { image, workgroups: counter.take().workgroups };
  };
  const [small, tiny] = [await draw(Infinity), await draw(0)];
  assert.ok(tiny.workgroups > small.workgroups, 'the image has more tiles');
  assert.ok(largest(small.image, tiny.image) <= MAX_DIFFERENCE, 'a pixel differs');
  renderer.destroy();
  gaussians.destroy();
});

function largest(a: Float32Array, b: Float32Array): number {
  let worst = 0;
  a.forEach((value, i) => (worst = Math.max(worst, Math.abs(value - b[i]))));
  return worst;
}
