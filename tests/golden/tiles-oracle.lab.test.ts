/** The compute rasterizer against the oracle. It blends in float32 and stops as the reference does, so it is held tighter. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { setTimeout as pause } from 'node:timers/promises';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { cloudOf, repeat } from '../support/clouds.js';
import { renderOracle } from '../oracle/oracle.js';
import { closeness, compareWithOracle, describeCloseness, renderCloud } from '../support/compare.js';
import { endNodeDevice, anyDevice } from '../support/node-device.js';
import { faultyDevice } from '../stability/support/devices.js';
import {
  brightColors,
  cameraAt,
  edgeOnDiscs,
  hugeSplats,
  needles,
  offCenter,
  opacitySteps,
  resized,
} from '../support/scenes.js';
import { capture, Renderer } from '../support/renderer.js';

/** Colors around 4 cost more in a float16 target than those around 1. */
const LIMITS = { psnr: 69, p999: 0.5 / 255 };

/**
 * The worst pixel: a splat more or less at its rim, at which alpha is 1/255 and shapes stored to 14 bits decide differently from float64, is 1/255
 * of its color, and colors reach 4 in one scene.
 */
const worstOf = (scene: string): number => (scene === 'brightColors' ? 4.3 : 1.1) / 255;

for (const make of [needles, hugeSplats, opacitySteps, brightColors, edgeOnDiscs, offCenter]) {
  test(`tiles: ${make.name}`, async () => {
    const { name, cloud, cameras } = make();
    for (const [i, whole] of cameras.entries()) {
      // Tiles are slow on SwiftShader, by the pixel; these show the difficulties of a scene.
      const camera = resized(whole, 180);
      const close = await compareWithOracle(await anyDevice(), cloud, camera, 'classic', { rasterizer: 'tiles' });
      console.log(describeCloseness(`tiles ${name} ${i}`, close));
      assert.ok(close.psnr >= LIMITS.psnr, `${name}: ${close.psnr} dB`);
      assert.ok(close.p999 <= LIMITS.p999, `${name}: 99.9th percentile ${255 * close.p999}/255`);
      assert.ok(close.max <= worstOf(name), `${name}: worst ${255 * close.max}/255`);
    }
  });
}

/** Stages before the tiles that SwiftShader compiles quickly. */
const SERIAL = { rasterizer: 'tiles', threads: 'serial', sort: 'serial' } as const;

/** Storing truncates values beyond the format's precision, as an NVIDIA H200 does with float16. */
const cutsOff = (stored: string): Promise<{ device: GPUDevice; befallen: string[] }> =>
  faultyDevice([
    {
      shader: /rasterize_tiles/,
      from: 'textureStore(image, position, result)',
      to: `textureStore(image, position, ${stored})`,
    },
  ]);

test('tiles: an adapter that cuts off what float16 has no room for stores the same', async () => {
  const { cloud, cameras } = brightColors();
  const camera = resized(cameras[0], 100);
  const { device, befallen } = await cutsOff('bitcast<vec4f>(bitcast<vec4u>(result) & vec4u(0xffffe000u))');
  const [exact, cut] = await Promise.all(
    [await anyDevice(), device].map((each) => renderCloud(each, cloud, camera, 'classic', SERIAL)),
  );
  assert.ok(befallen.length > 0, 'the shader was changed');
  assert.deepEqual(cut, exact);
  device.destroy();
});

test('tiles: bytes are the nearest, on an adapter that cuts off, too', async () => {
  const { cloud, cameras } = offCenter();
  const camera = resized(cameras[0], 100);
  const { device, befallen } = await cutsOff('floor(saturate(result) * 255.0) / 255.0');
  const [exact, cut] = [await bytesOf(await anyDevice(), cloud, camera), await bytesOf(device, cloud, camera)];
  assert.ok(befallen.length > 0, 'the shader was changed');
  assert.deepEqual(cut, exact);
  device.destroy();
  const floats = await renderCloud(await anyDevice(), cloud, camera, 'classic', SERIAL);
  // Half a step, and what float16 rounds.
  const worst = floats.reduce((max, x, i) => Math.max(max, Math.abs(255 * Math.min(1, x) - exact[i])), 0);
  assert.ok(worst <= 0.5 + 255 * 2 ** -12, `${worst} steps`);
});

/** [height, width, 4] bytes that tiles write into a texture of 8 bits themselves. */
async function bytesOf(device: GPUDevice, cloud: GaussianCloud, camera: Camera): Promise<Uint8Array> {
  const { width, height } = camera;
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, SERIAL);
  const usage = GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC;
  const target = device.createTexture({ size: [width, height], format: 'rgba8unorm', usage });
  const bytesPerRow = 256 * Math.ceil((4 * width) / 256);
  const staging = device.createBuffer({
    size: bytesPerRow * height,
    usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ,
  });
  renderer.render({ gaussians, camera, target });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture: target }, { buffer: staging, bytesPerRow }, [width, height]);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(GPUMapMode.READ);
  const rows = new Uint8Array(staging.getMappedRange());
  const bytes = new Uint8Array(4 * width * height);
  for (let y = 0; y < height; y++)
    bytes.set(rows.subarray(y * bytesPerRow, y * bytesPerRow + 4 * width), 4 * width * y);
  renderer.destroy();
  gaussians.destroy();
  return bytes;
}

/** 8,000 splats over all 18 bins of the image: 144,000 pairs, and room for 65,536. The nearest few hide all others. */
const crowd = cloudOf(
  repeat(8000, (i) => ({
    position: [0, 0, 0.0006 * i],
    scale: [40, 40, 0.001],
    opacity: 0.995,
    color: [(i % 7) / 7, (i % 5) / 5, (i % 3) / 3],
  })),
);
const crowdCamera = cameraAt([0, 0, -3], [0, 0, 0], { width: 64, height: 1100 });

test('tiles: over capacity the farthest pairs are left out, the frame says so, and the next one has room', async () => {
  const device = await anyDevice();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(crowd));
  let reported: () => void = () => undefined;
  const incomplete = new Promise<void>((resolve) => (reported = resolve));
  const renderer = new Renderer(device, { rasterizer: 'tiles', onIncomplete: () => reported() });
  const target = device.createTexture({ size: [64, 1100], format: 'rgba16float', usage: 0x8 | 0x10 });
  renderer.render({ gaussians, camera: crowdCamera, target });
  const first = await renderer.stats();
  assert.deepEqual([first.pairs, first.pairOverflow], [65_536, 144_000 - 65_536]);
  await incomplete;
  const close = closeness(
    await capture(device, renderer, { gaussians, camera: crowdCamera }),
    renderOracle(crowd, crowdCamera, { rules: 'gsplat', mode: 'classic' }),
  );
  console.log(describeCloseness('tiles with room again', close));
  assert.ok(close.psnr >= LIMITS.psnr && close.max <= worstOf(''), `${close.psnr} dB, worst ${255 * close.max}/255`);
  const second = await renderer.stats();
  assert.deepEqual([second.pairs, second.pairOverflow], [144_000, 0]);
});

for (const [what, cameras, pauseMs] of [
  [
    'larger',
    [
      { width: 32, height: 64 },
      { width: 64, height: 1100 },
    ],
    0,
  ],
  [
    'after a pause',
    [
      { width: 64, height: 1100, far: true },
      { width: 64, height: 1100 },
    ],
    300,
  ],
] as const) {
  test(`tiles: a single frame that is ${what} is read back, and its missing capacity is reported`, async () => {
    const device = await anyDevice();
    const gaussians = await GaussianBuffers.upload(device, packGaussians(crowd));
    let reported = 0;
    const renderer = new Renderer(device, { rasterizer: 'tiles', onIncomplete: () => reported++ });
    const [before, after] = cameras.map(({ width, height, ...rest }) =>
      cameraAt([0, 0, 'far' in rest ? -2000 : -3], [0, 0, 0], { width, height }),
    );
    const targetOf = ({ width, height }: Camera): GPUTexture =>
      device.createTexture({ size: [width, height], format: 'rgba16float', usage: 0x8 | 0x10 });
    // The number of a view's third frame is ignored.
    for (let frame = 0; frame < 2; frame++) {
      renderer.render({ gaussians, camera: before, target: targetOf(before) });
      assert.equal((await renderer.stats()).pairOverflow, 0);
    }
    await pause(pauseMs);
    renderer.render({ gaussians, camera: after, target: targetOf(after) });
    assert.ok((await renderer.stats()).pairOverflow > 0);
    await pause(50);
    assert.equal(reported, 1);
  });
}

after(endNodeDevice);
