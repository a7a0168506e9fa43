/** Requests that types alone would refuse: errors with a name, before any call of the device. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { cameraFromCalibration, type CalibratedView } from '@gaussian-splat/core';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { someOf } from '../support/extent.js';
import { cloudOf } from '../support/clouds.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { cameraAt } from '../support/scenes.js';
import { capture, Renderer, type FrameRequest } from '../support/renderer.js';

const camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 32, height: 24 });
const columnMajor = Array.from({ length: 16 }, (_, k) => camera.worldToCamera[4 * (k % 4) + Math.floor(k / 4)]);
/** Right and down are the same. */
const flat = Array.from(camera.worldToCamera, (x, k) => (k >= 4 && k < 8 ? camera.worldToCamera[k - 4] : x));

const FAULTY: readonly (readonly [name: string, changes: object, code: string])[] = [
  ['settings that are null', { settings: null }, 'argument/value'],
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

/** Textures that cannot be drawn into, or not as they are. */
const TARGETS: readonly (readonly [name: string, descriptor: Partial<GPUTextureDescriptor>])[] = [
  ['several samples a pixel', { sampleCount: 4 }],
  ['whole numbers', { format: 'rgba8uint' }],
  ['depths', { format: 'depth24plus' }],
  ['three dimensions', { dimension: '3d', size: [32, 24, 4], usage: 0x4 }],
  ['another size', { size: [64, 48] }],
  ['no usage that draws', { usage: 0x4 }],
];

test('targets that cannot be drawn into are refused by name, and the device gets no error', async () => {
  const device = await anyDevice();
  const cloud = cloudOf([{ position: [0, 0, 0], scale: 0.3, opacity: 0.9, color: [1, 0, 0] }]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const renderer = new Renderer(device);
  device.pushErrorScope('validation');
  for (const [name, descriptor] of TARGETS) {
    const target = device.createTexture({ size: [32, 24], format: 'rgba8unorm', usage: 0x10, ...descriptor });
    assert.throws(() => renderer.render({ gaussians, camera, target }), { code: 'argument/value' }, name);
    target.destroy();
  }
  const view = device.createTexture({ size: [32, 24], format: 'rgba8uint', usage: 0x10 }).createView();
  const asked = { gaussians, camera, target: view, targetFormat: 'rgba8uint' } as const;
  assert.throws(() => renderer.render(asked), { code: 'argument/value' });
  assert.equal(await device.popErrorScope(), null);
  [renderer, gaussians].forEach((thing) => thing.destroy());
});

test('targets that encode what is written hold the same numbers as others', async () => {
  const device = await anyDevice();
  const cloud = cloudOf([
    { position: [-0.3, 0, 0], scale: 0.3, opacity: 0.9, color: [0.9, 0.4, 0.05] },
    { position: [0.4, 0.1, 0.2], scale: 0.4, opacity: 0.5, color: [0.02, 0.6, 1] },
  ]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const bytes = async (rasterizer: 'quads' | 'tiles', format: GPUTextureFormat): Promise<Uint8Array> => {
    const renderer = new Renderer(device, { rasterizer });
    const target = device.createTexture({ size: [32, 24], format, usage: 0x11 });
    renderer.render({ gaussians, camera, target, background: [0.1, 0.2, 0.3, 1] });
    const staging = device.createBuffer({ size: 256 * 24, usage: 0x9 });
    const encoder = device.createCommandEncoder();
    encoder.copyTextureToBuffer({ texture: target }, { buffer: staging, bytesPerRow: 256 }, [32, 24]);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    const found = new Uint8Array(staging.getMappedRange().slice(0));
    [target, staging, renderer].forEach((thing) => thing.destroy());
    return found;
  };
  for (const rasterizer of someOf(['quads', 'tiles'] as const, 1)) {
    const plain = await bytes(rasterizer, 'rgba8unorm');
    const encoding = await bytes(rasterizer, 'rgba8unorm-srgb');
    assert.ok(plain.some((byte) => byte > 200));
    const worst = plain.reduce((max, byte, i) => Math.max(max, Math.abs(byte - encoding[i])), 0);
    assert.ok(worst <= 1, `${rasterizer}: ${worst} steps of 255`);
  }
  gaussians.destroy();
});

after(endNodeDevice);
