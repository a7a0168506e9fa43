/** Shapes of a host's depth through scenes: a leaning plane, a sphere, a bar two pixels wide. Both rasterizers end each pixel at the float64 oracle's splat. `npm test` has a bar and a wall in world.alone.test.ts. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
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
import { referenceViews } from '../support/cameras.js';
import { closeness } from '../support/compare.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { onlyInLab } from '../support/extent.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { resized, room } from '../support/scenes.js';

after(endNodeDevice);

const LIMIT_DB = 59;
/** Lower limit of PSNR between frames with and without the shape: it hides a large part below it. */
const MUCH_DB = 45;

/** Depth along the camera's axis at which the ray of a pixel meets a shape; Infinity if it misses. `x` and `y` are its slopes, `at` the depth of the scene's middle. */
type Shape = (x: number, y: number, at: number, pixel: number) => number;

const SHAPES: Readonly<Record<string, Shape>> = {
  'a plane that leans through it': (x, y, at) => at / (1 - 0.9 * x + 0.5 * y),
  'a sphere in it': (x, y, at) => {
    const radius = 0.16 * at;
    const square = x * x + y * y + 1;
    // The nearer root of |t (x, y, 1) - (0, 0, at)| = radius.
    const root = at * at - square * (at * at - radius * radius);
    return root < 0 ? Infinity : (at - Math.sqrt(root)) / square;
  },
  'a bar of two pixels': (x, y, at, pixel) => (Math.abs(y - 0.3 * x) > pixel ? Infinity : at / (1 - 0.6 * x)),
};

function depthsOf(shape: Shape, { width, height, fx, fy, cx, cy }: Camera, at: number): Float32Array {
  return Float32Array.from({ length: width * height }, (_, i) => {
    const [x, y] = [((i % width) + 0.5 - cx) / fx, (Math.floor(i / width) + 0.5 - cy) / fy];
    const depth = shape(x, y, at, 1 / fy);
    return depth > 0 ? depth : Infinity;
  });
}

async function holdAll(name: string, cloud: GaussianCloud, camera: Camera): Promise<void> {
  const device = await serialDevice();
  const { width, height } = camera;
  const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
  const world = new World();
  world.add({ scene });
  const mode = cloud.antialiased ? 'antialiased' : 'classic';
  const whole = renderOracleWorld([{ cloud, mode }], camera, { rules: 'gsplat' });
  // The depth of the visible surface in half of the pixels: shapes there hide and are hidden.
  const seen = whole.medianDepth.filter((value) => value > 0).sort();
  const at = seen[seen.length >> 1];
  for (const [what, shape] of Object.entries(SHAPES)) {
    const depths = depthsOf(shape, camera, at);
    const oracle = renderOracleWorld([{ cloud, mode }], camera, { rules: 'gsplat', depth: depths });
    const texture = device.createTexture({ size: [width, height], format: 'r32float', usage: 0x6 });
    // 0 is nothing.
    const stored = depths.map((depth) => (depth === Infinity ? 0 : depth));
    device.queue.writeTexture({ texture }, stored, { bytesPerRow: 4 * width }, [width, height]);
    const depth = new SceneDepth(device, { host: { texture } });
    for (const rasterizer of ['quads', 'tiles'] as const) {
      const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer }) });
      const pixels = await capture(device, viewpoint, { camera, depth });
      const { psnr, max } = closeness(pixels, oracle);
      console.log(`${name}, ${what}, ${rasterizer}: ${psnr.toFixed(1)} dB, worst ${(255 * max).toFixed(2)}/255`);
      assert.ok(psnr >= LIMIT_DB, `${name}, ${what}, ${rasterizer}: ${psnr} dB`);
      assert.ok(closeness(pixels, whole).psnr < MUCH_DB, `${what} hides something`);
      viewpoint.destroy();
    }
    depth.destroy();
    texture.destroy();
  }
  scene.destroy();
}

test('through a room', { skip: onlyInLab }, async () => {
  const { name, cloud, cameras } = room();
  await holdAll(name, cloud, resized(cameras[0], 160));
});

for (const file of ['skull', 'playbot3']) {
  const skip = onlyInLab || needsSharedData;
  test(`through ${file}`, { skip }, async () => {
    const view = referenceViews().find(({ name }) => name.startsWith(file))!;
    const cloud = await readScene(sharedFile(view.file), { name: view.file });
    await holdAll(view.name, cloud, resized(view.camera, 240));
  });
}
