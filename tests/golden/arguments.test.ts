/** Requests that types alone would refuse: errors with a name, before the device hears of anything. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { cameraFromCalibration, type CalibratedView } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, Renderer, type FrameRequest } from '@gaussian-splat/renderer';
import { cloudOf } from '../support/clouds.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';

const camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 32, height: 24 });
const columnMajor = Array.from({ length: 16 }, (_, k) => camera.worldToCamera[4 * (k % 4) + Math.floor(k / 4)]);
/** Right and down are the same. */
const flat = Array.from(camera.worldToCamera, (x, k) => (k >= 4 && k < 8 ? camera.worldToCamera[k - 4] : x));

const FAULTY: readonly (readonly [name: string, changes: object, code: string])[] = [
  ['no scene', { gaussians: undefined }, 'argument/value'],
  ['a list with a gap', { gaussians: [undefined] }, 'argument/value'],
  ['levers that are null', { levers: null }, 'argument/value'],
  ['a background of three numbers', { background: [0, 0, 0] }, 'argument/value'],
  ['a background that is not a number', { background: [0, 0, NaN, 1] }, 'argument/value'],
  ['a matrix of columns', { camera: { ...camera, worldToCamera: columnMajor } }, 'argument/camera'],
  [
    'a matrix of zeros',
    { camera: { ...camera, worldToCamera: flat.map((_, k) => Number(k === 15)) } },
    'argument/camera',
  ],
  ['a matrix that makes space flat', { camera: { ...camera, worldToCamera: flat } }, 'argument/camera'],
  ['no width', { camera: { ...camera, width: 0 } }, 'argument/camera'],
  ['more pixels than textures have', { camera: { ...camera, width: 1 << 20 } }, 'argument/camera'],
];

for (const [name, changes, code] of FAULTY) {
  test(`${name}: ${code}, and nothing else`, async () => {
    const device = await anyDevice();
    const uncaptured: string[] = [];
    const listen = ({ error }: GPUUncapturedErrorEvent): void => void uncaptured.push(error.message);
    device.addEventListener('uncapturederror', listen);
    const cloud = cloudOf([{ position: [0, 0, 0], scale: 0.3, opacity: 0.9, color: [1, 0, 0] }]);
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const renderer = new Renderer(device);
    const request = { gaussians, camera, ...changes } as Omit<FrameRequest, 'target'>;
    await assert.rejects(capture(device, renderer, request), { code });
    const target = device.createTexture({ size: [32, 24], format: 'rgba8unorm', usage: 0x10 });
    assert.throws(() => renderer.render({ ...request, target }), { code });
    await device.queue.onSubmittedWorkDone();
    assert.deepEqual(uncaptured, []);
    device.removeEventListener('uncapturederror', listen);
    [target, renderer, gaussians].forEach((thing) => thing.destroy());
  });
}

test('a calibration whose K is no such matrix is refused by the number that is not', () => {
  const rows = [0, 4, 8, 12].map((k) => Array.from(camera.worldToCamera.slice(k, k + 4)));
  const K = [
    [30, 0, 16],
    [0, 30, 12],
    [0, 0, 1],
  ];
  const view: CalibratedView = { width: 32, height: 24, K, worldToCamera: rows };
  assert.equal(cameraFromCalibration(view).cx, 16);
  const columns = K.map((_, i) => K.map((row) => row[i]));
  const scaled = K.map((row) => row.map((x) => 2 * x));
  const sheared = K.map((row, i) => (i === 1 ? [5, 30, 12] : row));
  for (const [wrong, where] of [
    [columns, 'view.K[2][0]'],
    [scaled, 'view.K[2][2]'],
    [sheared, 'view.K[1][0]'],
  ] as const)
    assert.throws(() => cameraFromCalibration({ ...view, K: wrong }, 'view'), { code: 'argument/camera', where });
});

test('a target with levels and layers: the first is drawn into', async () => {
  const device = await anyDevice();
  const cloud = cloudOf([{ position: [0, 0, 0], scale: 0.3, opacity: 0.9, color: [1, 0, 0] }]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device, { rasterizer: 'quads' });
  const size = [32, 24, 2];
  const target = device.createTexture({ size, mipLevelCount: 3, format: 'rgba8unorm', usage: 0x11 });
  device.pushErrorScope('validation');
  renderer.render({ gaussians, camera, target });
  assert.equal(await device.popErrorScope(), null);
  const staging = device.createBuffer({ size: 256 * 24, usage: 0x9 });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture: target }, { buffer: staging, bytesPerRow: 256 }, [32, 24]);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const red = new Uint8Array(staging.getMappedRange())[256 * 12 + 4 * 16];
  assert.ok(red > 200, `red ${red} in the middle`);
  [target, staging, renderer, gaussians].forEach((thing) => thing.destroy());
});

after(endNodeDevice);
