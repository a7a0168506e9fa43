/** A host's frame: recorded into its encoder, over its content, in its colors, from its matrices, several views at once. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { cameraFromProjection, multiply, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  capture,
  GaussianBuffers,
  LinearColors,
  packGaussians,
  SceneDepth,
  settings,
  Viewpoint,
  World,
  type FrameSettings,
  type FrameTarget,
} from '@gaussian-splat/renderer';
import { toCamera } from '../oracle/projection.js';
import { someOf } from '../support/extent.js';
import { randomSource } from '../support/gpu.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { readTexture } from '../support/read-frame.js';
import { cameraAt, room, thinned } from '../support/scenes.js';
import { countWork } from '../support/work-counters.js';

after(endNodeDevice);

const camera = cameraAt([0.5, -0.4, -2.5], [0, 0, 0], { width: 96, height: 64 });
const CLEAR = [0.2, 0.5, 0.1] as const;

async function skullWorld(device: GPUDevice) {
  const scene = await GaussianBuffers.upload(device, packGaussians(thinned(room(), 3000).cloud));
  const world = new World();
  world.add({ scene });
  return { scene, world };
}

const target = (device: GPUDevice, format: GPUTextureFormat, { width, height } = camera): GPUTexture =>
  device.createTexture({ size: [width, height], format, usage: 0x15 });

function clear(encoder: GPUCommandEncoder, texture: GPUTexture, [r, g, b]: readonly number[]): void {
  encoder
    .beginRenderPass({
      colorAttachments: [
        { view: texture.createView(), loadOp: 'clear', storeOp: 'store', clearValue: { r, g, b, a: 1 } },
      ],
    })
    .end();
}

const decode = (c: number): number => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
const encode = (c: number): number => (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055);

const BOTH: readonly FrameSettings[] = [
  settings('default', { rasterizer: 'quads' }),
  settings('default', { rasterizer: 'tiles' }),
];

// SwiftShader compiles tiles for seconds.
for (const how of someOf(BOTH, 1)) {
  test(`${how.rasterizer}: a frame in a host's encoder, over what it has drawn, is the frame over that color`, async () => {
    const device = await serialDevice();
    const { world, scene } = await skullWorld(device);
    const viewpoint = new Viewpoint(device, world, { settings: how });
    const expected = await capture(device, viewpoint, { camera, background: [...CLEAR, 1] });
    device.pushErrorScope('validation');
    for (const format of someOf(['rgba8unorm', 'rgba16float'] as const, how.rasterizer === 'quads' ? 2 : 1)) {
      const texture = target(device, format);
      const counter = countWork(device);
      for (let frame = 0; frame < 3; frame++) {
        const encoder = device.createCommandEncoder();
        clear(encoder, texture, CLEAR);
        counter.take();
        viewpoint.record(encoder, camera, { target: texture, background: 'load' });
        assert.equal(counter.take().submits, 0, 'the host submits');
        device.queue.submit([encoder.finish()]);
        await new Promise((resolve) => setTimeout(resolve, 1));
      }
      const found = await readTexture(device, texture);
      const worst = found.reduce((max, value, i) => Math.max(max, Math.abs(value - Math.min(1, expected[i]))), 0);
      assert.ok(worst <= 1.6 / 255, `${format}: ${255 * worst} / 255`);
      texture.destroy();
    }
    assert.equal(await device.popErrorScope(), null);
    viewpoint.destroy();
    scene.destroy();
  });

  test(`${how.rasterizer}: two frames that a host records and submits in one task are valid`, async () => {
    const device = await serialDevice();
    const { world, scene } = await skullWorld(device);
    const viewpoint = new Viewpoint(device, world, { settings: how, limitsOverdraw: true });
    const small: Camera = { ...camera, width: 48, height: 32, fx: camera.fx / 2, fy: camera.fy / 2, cx: 24, cy: 16 };
    const cameras = [camera, small];
    const targets = cameras.map((each) => target(device, 'rgba8unorm', each));
    viewpoint.maxSizes = 2;
    device.pushErrorScope('validation');
    for (let frame = 0; frame < 3; frame++) {
      for (const [k, each] of cameras.entries()) {
        const encoder = device.createCommandEncoder();
        viewpoint.record(encoder, each, { target: targets[k] });
        device.queue.submit([encoder.finish()]);
      }
      await new Promise((resolve) => setTimeout(resolve, 1));
      await device.queue.onSubmittedWorkDone();
    }
    assert.equal(await device.popErrorScope(), null);
    for (const owner of [viewpoint, scene, ...targets]) owner.destroy();
  });

  test(`${how.rasterizer}: over linear light splats are blended in encoded colors`, async () => {
    const device = await serialDevice();
    const { world, scene } = await skullWorld(device);
    const viewpoint = new Viewpoint(device, world, { settings: how });
    const expected = await capture(device, viewpoint, { camera, background: [...CLEAR, 1] });
    const colors = new LinearColors(device);
    for (const format of someOf(['rgba8unorm-srgb', 'rgba16float'] as const, how.rasterizer === 'quads' ? 2 : 1)) {
      const texture = target(device, format);
      const encoder = device.createCommandEncoder();
      clear(encoder, texture, CLEAR.map(decode));
      viewpoint.record(encoder, camera, { target: texture, background: 'load', colors });
      device.queue.submit([encoder.finish()]);
      const found = await readTexture(device, texture);
      const isEncoded = format.endsWith('-srgb');
      let worst = 0;
      found.forEach((value, i) => {
        if (i % 4 === 3) return;
        const own = isEncoded ? value : encode(value);
        worst = Math.max(worst, Math.abs(own - (isEncoded ? Math.min(1, expected[i]) : expected[i])));
      });
      assert.ok(worst <= 1.6 / 255, `${format}: ${255 * worst} / 255`);
      texture.destroy();
    }
    const texture = target(device, 'rgba8unorm-srgb');
    assert.throws(() => viewpoint.draw(camera, { target: texture, background: 'load' }), {
      where: 'FrameTarget.colors',
    });
    colors.destroy();
    viewpoint.destroy();
    scene.destroy();
  });
}

test('several views at once are as each alone, and keep their buffers', async () => {
  const device = await serialDevice();
  const { world, scene } = await skullWorld(device);
  const viewpoint = new Viewpoint(device, world, { settings: BOTH[0] });
  const right: Camera = {
    ...camera,
    worldToCamera: multiply([1, 0, 0, -0.06, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], camera.worldToCamera),
  };
  const small: Camera = { ...camera, width: 48, height: 32, fx: camera.fx / 2, fy: camera.fy / 2, cx: 24, cy: 16 };
  const cameras = [camera, right, small];
  const targets = cameras.map((each) => target(device, 'rgba8unorm', each));
  const views = cameras.map((each, k) => ({ camera: each, target: { target: targets[k] } }));
  const drawAll = (): void => views.forEach((each) => viewpoint.draw(each.camera, each.target));
  viewpoint.maxSizes = 2;
  drawAll();
  const found = await Promise.all(targets.map((texture) => readTexture(device, texture)));
  for (const [k, each] of cameras.entries()) {
    const alone = new Viewpoint(device, world, { settings: BOTH[0] });
    alone.draw(each, { target: targets[k] });
    assert.deepEqual(found[k], await readTexture(device, targets[k]), `view ${k}`);
    alone.destroy();
  }
  const counter = countWork(device);
  drawAll();
  counter.take();
  drawAll();
  const { buffersCreated, bytesAllocated } = counter.take();
  assert.deepEqual([buffersCreated, bytesAllocated], [0, 0]);
  viewpoint.destroy();
  scene.destroy();
});

test('a camera of a host sees what the host sees', () => {
  const random = randomSource(4);
  const [width, height] = [320, 200];
  const transposed = (m: readonly number[]): number[] => m.map((_, k) => m[4 * (k % 4) + Math.floor(k / 4)]);
  const view = transposed([0.8, 0, 0.6, 0.3, 0, 1, 0, -0.2, -0.6, 0, 0.8, -4, 0, 0, 0, 1]);
  const perspective = (near: number, far: number, low: number): number[] => {
    // Depth is `low` at the near plane and 1 at the far one.
    const [b, a] = [(near * far * (1 - low)) / (near - far), (far - low * near) / (near - far)];
    return transposed([1.3, 0, 0.1, 0, 0, 2.1, -0.2, 0, 0, 0, a, b, 0, 0, -1, 0]);
  };
  const orthographic = (near: number, far: number): number[] =>
    transposed([0.2, 0, 0, 0.1, 0, 0.3, 0, -0.05, 0, 0, -1 / (far - near), -near / (far - near), 0, 0, 0, 1]);
  const cases = [
    { projection: perspective(0.1, 50, 0), near: 0.1, far: 50 },
    { projection: perspective(0.1, 50, -1), near: 0.1, far: 50, clipDepth: '-1..1' as const },
    // Reversed, and without a far plane.
    { projection: transposed([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.3, 0, 0, -1, 0]), near: 0.3, far: Infinity },
    { projection: orthographic(1, 30), near: 1, far: 30 },
    { projection: orthographic(-10, 30), near: 0.04, far: 40.04 },
  ];
  for (const { projection: p, near, far, clipDepth } of cases) {
    const found = cameraFromProjection(view, p, { width, height, clipDepth });
    assert.ok(
      Math.abs(found.near - near) < 1e-9 && (found.far === far || Math.abs(found.far - far) < 1e-6),
      `${found.near} ${found.far}`,
    );
    for (let k = 0; k < 20; k++) {
      const point: Vector3 = [random() - 0.5, random() - 0.5, random() - 0.5];
      const column = (m: readonly number[], [x, y, z, w]: readonly number[]): number[] =>
        [0, 1, 2, 3].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r] * w);
      const clip = column(p, column(view, [...point, 1]));
      const [x, y, z] = toCamera(found, point);
      const shrink = found.orthographic ? 1 : z;
      assert.ok(Math.abs((found.fx * x) / shrink + found.cx - ((clip[0] / clip[3] + 1) / 2) * width) < 1e-6);
      assert.ok(Math.abs((found.fy * y) / shrink + found.cy - ((1 - clip[1] / clip[3]) / 2) * height) < 1e-6);
    }
  }
  const skewed = [...perspective(0.1, 50, 0)];
  skewed[4] = 0.1;
  assert.throws(() => cameraFromProjection(view, skewed, { width, height }), { code: 'argument/camera' });
});

test('bad requests are named', async () => {
  const device = await serialDevice();
  const { world, scene } = await skullWorld(device);
  const viewpoint = new Viewpoint(device, world, { settings: BOTH[0] });
  const texture = (format: GPUTextureFormat, more: Partial<GPUTextureDescriptor> = {}): GPUTexture =>
    device.createTexture({ size: [camera.width, camera.height], format, usage: 0x14, ...more });
  const host = (each: GPUTexture) => new SceneDepth(device, { host: { texture: each } });
  const refused: readonly [name: string, attempt: () => unknown, where: string][] = [
    [
      'several samples',
      () => viewpoint.draw(camera, { target: texture('rgba8unorm', { sampleCount: 4 }) }),
      'FrameTarget.target',
    ],
    ['integers', () => viewpoint.draw(camera, { target: texture('rgba8uint') }), 'FrameTarget.target'],
    [
      'another size',
      () => viewpoint.draw(camera, { target: texture('rgba8unorm', { size: [8, 8] }) }),
      'FrameTarget.target',
    ],
    ['no target', () => viewpoint.draw(camera, {} as FrameTarget), 'FrameTarget.target'],
    ['a view without its format', () => viewpoint.draw(camera, { target: {} as GPUTexture }), 'FrameTarget.target'],
    ['depth of several samples', () => host(texture('depth32float', { sampleCount: 4 })), 'HostDepth.texture'],
    ['depth in colors', () => host(texture('rgba8unorm')), 'HostDepth.texture'],
    ['depth that cannot be read', () => host(texture('depth32float', { usage: 0x10 })), 'HostDepth.texture'],
    ['no depth', () => new SceneDepth(device, {}), 'SceneDepth'],
    [
      'median depth of quads',
      () =>
        viewpoint.draw(camera, {
          target: texture('rgba8unorm'),
          depth: new SceneDepth(device, { out: texture('r32float', { usage: 8 }) }),
        }),
      'SceneDepth.out',
    ],
    [
      'a flat scene',
      () => world.add({ scene, sceneToWorld: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1] }),
      'Placement.sceneToWorld',
    ],
    [
      'columns for rows',
      () => world.add({ scene, sceneToWorld: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1] }),
      'Placement.sceneToWorld',
    ],
    ['too opaque', () => (world.placements[0].opacity = 2), 'Placement.opacity'],
    ['a crop of one corner', () => (world.placements[0].crop = { min: [0, 0, 0] } as never), 'Placement.crop'],
    ['no scene', () => world.add({ scene: undefined as never }), 'Placement.scene'],
  ];
  for (const [name, attempt, where] of refused) assert.throws(attempt, { where }, name);
  assert.equal(world.placements.length, 1, 'what was refused is not added');
  viewpoint.destroy();
  scene.destroy();
});
