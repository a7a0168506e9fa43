/** Auxiliary outputs of tiles besides the image: the contribution of each splat. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs, packedOrder, readBack } from '@gaussian-splat/renderer/tools';
import { renderOracle } from '../oracle/oracle.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { readFrame } from '../support/read-frame.js';
import { resized, room } from '../support/scenes.js';
import { Renderer } from '../support/renderer.js';

async function readBuffer(device: GPUDevice, buffer: GPUBuffer): Promise<Float32Array> {
  const [bytes] = await readBack(device, [{ buffer }]);
  return new Float32Array(bytes);
}

/** Auxiliary outputs of two frames of a turned camera. The second one counts. */
async function notesOf(device: GPUDevice, cloud: GaussianCloud, cameras: readonly Camera[]) {
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { rasterizer: 'tiles' });
  const contributions = device.createBuffer({
    size: 4 * 256 * Math.ceil(cloud.count / 256),
    usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST,
  });
  const images: Float32Array[] = [];
  for (const camera of cameras) {
    images.push(
      await readFrame(device, renderer, {
        gaussians,
        camera,
        auxiliary: new AuxiliaryOutputs({ contributions }),
      }),
    );
  }
  const weights = await readBuffer(device, contributions);
  const plain = await readFrame(device, renderer, { gaussians, camera: cameras.at(-1)! });
  contributions.destroy();
  renderer.destroy();
  gaussians.destroy();
  return { weights, image: images.at(-1)!, plain };
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
