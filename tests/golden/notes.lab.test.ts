/** Auxiliary outputs of tiles besides the image: the contribution of each splat, and the depth of each pixel. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs, packedOrder } from '@gaussian-splat/renderer/tools';
import { toCamera, worldPosition } from '../oracle/projection.js';
import { renderOracle } from '../oracle/oracle.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { resized, room } from '../support/scenes.js';
import { Renderer } from '../support/renderer.js';

async function readBuffer(device: GPUDevice, source: GPUBuffer | GPUTexture): Promise<Float32Array> {
  const isTexture = 'createView' in source;
  const bytesPerRow = isTexture ? Math.ceil((4 * source.width) / 256) * 256 : 0;
  const size = isTexture ? bytesPerRow * source.height : source.size;
  const staging = device.createBuffer({ size, usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ });
  const encoder = device.createCommandEncoder();
  if (isTexture) {
    encoder.copyTextureToBuffer({ texture: source }, { buffer: staging, bytesPerRow }, [source.width, source.height]);
  } else encoder.copyBufferToBuffer(source, 0, staging, 0, size);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(GPUMapMode.READ);
  const values = new Float32Array(staging.getMappedRange().slice(0));
  staging.destroy();
  if (!isTexture) return values;
  const stride = bytesPerRow / 4;
  return Float32Array.from(
    { length: source.width * source.height },
    (_, i) => values[stride * Math.floor(i / source.width) + (i % source.width)],
  );
}

/** Auxiliary outputs of two frames of a turned camera. The second one counts. */
async function notesOf(device: GPUDevice, cloud: GaussianCloud, cameras: readonly Camera[]) {
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { rasterizer: 'tiles' });
  const { width, height } = cameras[0];
  const contributions = device.createBuffer({
    size: 4 * 256 * Math.ceil(cloud.count / 256),
    usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST,
  });
  const usage = GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC;
  const depth = device.createTexture({ size: [width, height], format: 'r32float', usage });
  const images: Float32Array[] = [];
  for (const camera of cameras) {
    images.push(
      await readFrame(device, renderer, {
        gaussians,
        camera,
        auxiliary: new AuxiliaryOutputs({ contributions, depth }),
      }),
    );
  }
  const recorded = { weights: await readBuffer(device, contributions), depths: await readBuffer(device, depth) };
  const plain = await readFrame(device, renderer, { gaussians, camera: cameras.at(-1)! });
  contributions.destroy();
  depth.destroy();
  renderer.destroy();
  gaussians.destroy();
  return { ...recorded, image: images.at(-1)!, plain };
}

test('contributions are the largest weights that the oracle finds, over all frames; the image stays as it is', async () => {
  const device = await serialDevice();
  const { cloud, cameras } = room();
  const views = cameras.slice(0, 2).map((camera) => resized(camera, 160));
  const { weights, image, plain } = await notesOf(device, cloud, views);
  assert.deepEqual(Buffer.from(image.buffer), Buffer.from(plain.buffer));
  const oracles = views.map((camera) => renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' }));
  let [sum, seen, worst] = [0, 0, 0];
  packedOrder(cloud).forEach((index, slot) => {
    const expected = Math.max(...oracles.map(({ maxWeight }) => maxWeight[index]));
    const error = Math.abs(weights[slot] - expected);
    [sum, worst] = [sum + error, Math.max(worst, error)];
    if (expected > 0) seen++;
  });
  assert.ok(seen > 1000, `${seen} splats are seen: the case tests nothing`);
  assert.ok(worst < 0.01, `worst error ${worst}`);
  assert.ok(sum / cloud.count < 1e-4, `mean error ${sum / cloud.count}`);
});

test('depth is that of the splat at which a pixel becomes half transparent', async () => {
  const device = await serialDevice();
  const { cloud, cameras } = room();
  const camera = resized(cameras[0], 160);
  const { depths } = await notesOf(device, cloud, [camera]);
  const order = Array.from({ length: cloud.count }, (_, i) => i);
  const z = order.map((i) => toCamera(camera, worldPosition(cloud, i))[2]);
  const byDepth = order.filter((i) => z[i] > camera.near).sort((a, b) => z[a] - z[b]);
  // The oracle's transmittance of the scene cut off at a depth says on which side of it a pixel becomes half transparent.
  for (const share of [0.2, 0.5, 0.8]) {
    const cut = z[byDepth[Math.floor(share * byDepth.length)]];
    const { transmittance } = renderOracle(cloud, { ...camera, far: cut }, { rules: 'gsplat', mode: 'classic' });
    let wrong = 0;
    depths.forEach((depth, pixel) => {
      const isNear = depth > 0 && depth < cut * (1 - 1e-3);
      const isFar = depth === 0 || depth > cut * (1 + 1e-3);
      if ((isNear && transmittance[pixel] > 0.501) || (isFar && transmittance[pixel] < 0.499)) wrong++;
    });
    assert.equal(wrong, 0, `${wrong} pixels lie on the wrong side of depth ${cut}`);
  }
  assert.ok(depths.filter((depth) => depth > 0).length > depths.length / 4, 'hardly a pixel has a depth');
});

test('quads refuse auxiliary outputs, by name', async () => {
  const device = await serialDevice();
  const { cloud, cameras } = room();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { rasterizer: 'quads' });
  const target = device.createTexture({
    size: [cameras[0].width, cameras[0].height],
    format: 'rgba8unorm',
    usage: 0x10,
  });
  assert.throws(() => renderer.render({ gaussians, camera: cameras[0], target, auxiliary: new AuxiliaryOutputs() }), {
    code: 'unsupported/limits',
    where: 'FrameTarget.auxiliary',
  });
  renderer.destroy();
  gaussians.destroy();
  target.destroy();
});

after(endNodeDevice);
