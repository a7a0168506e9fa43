/** A host's images as layers of color among the splats: an antialiased card and a pane of glass, before, behind and between splats, against the float64 composite. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera } from '@gaussian-splat/core';
import {
  capture,
  GaussianBuffers,
  packGaussians,
  SceneDepth,
  settings,
  Viewpoint,
  World,
} from '@gaussian-splat/renderer';
import { renderOracleWorld } from '../oracle/oracle.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { closeness } from '../support/compare.js';
import { isLab } from '../support/extent.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';

after(endNodeDevice);

const camera: Camera = cameraAt([0, 0, -4], [0, 0, 0], { width: 112, height: 80 });
const pixels = camera.width * camera.height;

/** An opaque wall far away, and faint and opaque splats before it, on both sides of the layers. */
const random = seededRandom(47);
const cloud = cloudOf([
  ...repeat(500, (i) => ({
    position: [((i % 25) - 12) / 5, (Math.floor(i / 25) - 10) / 5, 2] as const,
    scale: 0.15,
    opacity: 0.95,
    color: [0.05, 0.1, 0.9] as const,
  })),
  ...repeat(300, () => ({
    position: [random.uniform(-1.5, 1.5), random.uniform(-1, 1), random.uniform(-1.2, 1.2)] as const,
    scale: [random.logUniform(0.03, 0.2), random.logUniform(0.03, 0.2), random.logUniform(0.03, 0.2)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.2, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)] as const,
  })),
]);

interface Drawn {
  readonly depth: Float32Array;
  readonly color: Float32Array;
}

/** A shape at a depth that leans: `cover` of a pixel, and its color. */
function drawn(cover: (x: number, y: number) => number, color: readonly number[], at: number, lean: number): Drawn {
  const depth = new Float32Array(pixels).fill(Infinity);
  const colors = new Float32Array(4 * pixels);
  for (let i = 0; i < pixels; i++) {
    const [x, y] = [(i % camera.width) + 0.5 - 56, Math.floor(i / camera.width) + 0.5 - 40];
    // Quarters, as of four samples.
    const share = Math.round(4 * cover(x, y)) / 4;
    if (share <= 0) continue;
    depth[i] = at + lean * x;
    colors.set([...color.slice(0, 3).map((c) => c * color[3] * share), color[3] * share], 4 * i);
  }
  return { depth, color: colors };
}

const within = (distance: number): number => Math.min(1, Math.max(0, 0.5 - distance));
const card = drawn(
  (x, y) => within(Math.abs(x + 0.3 * y) - 20.2) * within(Math.abs(y - 0.2 * x) - 14.6),
  [0, 0, 0, 1],
  4,
  0.012,
);
const pane = drawn((x, y) => within(Math.hypot(x - 18, y) - 22.3), [0.1, 0.8, 0.2, 0.5], 3.7, -0.02);

function upload(device: GPUDevice, { depth, color }: Drawn): { texture: GPUTexture; color: GPUTexture } {
  const size = [camera.width, camera.height];
  const make = (format: GPUTextureFormat, values: Float32Array, bytes: number): GPUTexture => {
    const texture = device.createTexture({ size, format, usage: 0x6 });
    device.queue.writeTexture(
      { texture },
      values as Float32Array<ArrayBuffer>,
      { bytesPerRow: bytes * camera.width },
      size,
    );
    return texture;
  };
  // 0 is nothing.
  return {
    texture: make(
      'r32float',
      depth.map((value) => (value === Infinity ? 0 : value)),
      4,
    ),
    color: make('rgba32float', color, 16),
  };
}

const ways = [{ rasterizer: 'tiles' }, { rasterizer: 'quads' }, { rasterizer: 'tiles', order: 'pixel' }] as const;

// SwiftShader compiles each kind of tiles for many seconds.
for (const way of ways.filter(({ rasterizer }) => isLab || rasterizer === 'quads')) {
  const { rasterizer, order = 'center' } = way as { rasterizer: 'tiles' | 'quads'; order?: 'center' | 'pixel' };
  test(`${rasterizer}, ordered by ${order}: layers lie among the splats`, async () => {
    const device = await serialDevice();
    const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
    const world = new World();
    world.add({ scene });
    const [first, second] = [upload(device, card), upload(device, pane)];
    const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer, order }) });
    const cases = [
      { what: 'a card', host: first, layers: [card] },
      { what: 'a card and a pane', host: { ...first, second }, layers: [card, pane] },
      ...(isLab ? [{ what: 'a pane and a card', host: { ...second, second: first }, layers: [pane, card] }] : []),
    ];
    device.pushErrorScope('validation');
    for (const { what, host, layers } of cases) {
      const depth = new SceneDepth(device, { host });
      const image = await capture(device, viewpoint, { camera, depth });
      const oracle = renderOracleWorld([{ cloud, mode: 'classic' }], camera, { rules: 'gsplat', layers, order });
      const close = closeness(image, oracle);
      console.log(
        `${rasterizer} ${order}, ${what}: ${close.psnrAll.toFixed(1)} dB, worst ${(255 * close.max).toFixed(1)} of 255`,
      );
      assert.ok(close.psnrAll >= (order === 'pixel' ? 45 : 59), `${what}: ${close.psnrAll} dB`);
      depth.destroy();
    }
    assert.equal((await device.popErrorScope())?.message, undefined);
    viewpoint.destroy();
    scene.destroy();
  });
}
