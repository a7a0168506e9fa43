/** Cuts against the float64 oracle: four shapes, soft and hard, of two scenes, with each action; and groups. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { lookAt, multiply, type Camera, type GaussianCloud, type Matrix4 } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, settings, Viewpoint, World } from '@gaussian-splat/renderer';
import { packedOrder } from '@gaussian-splat/renderer/tools';
import {
  lightened,
  recolored,
  SplatModifier,
  SplatProgram,
  tinted,
  type SplatCut,
} from '@gaussian-splat/renderer/modifiers';
import { cutCloud, normalBelow, type GroupedCloud } from '../oracle/cut.js';
import { renderOracleWorld } from '../oracle/oracle.js';
import { someOf } from '../support/extent.js';
import { closeness } from '../support/compare.js';
import { randomSource } from '../support/gpu.js';
import { psnr as psnrOf } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { cameraAt, needles, resized } from '../support/scenes.js';
import { UP } from '../support/scenes/scene.js';

after(endNodeDevice);

/** Leaning ellipsoids around the origin. */
function blobs(count: number): GaussianCloud {
  const random = randomSource(11);
  const fill = (length: number, value: (i: number) => number): Float32Array =>
    Float32Array.from({ length }, (_, i) => value(i));
  return {
    ...{ count, shDegree: 1, antialiased: false, origin: [0, 0, 0], droppedCount: 0 },
    positions: fill(3 * count, () => 2 * (random() - 0.5)),
    scales: fill(3 * count, () => 0.02 + 0.12 * random()),
    rotations: fill(4 * count, () => random() - 0.5),
    opacities: fill(count, () => 0.1 + 0.85 * random()),
    sh: fill(12 * count, (i) => (i % 12 < 3 ? 1.6 : 0.3) * (random() - 0.5)),
  };
}

const move = (x: number, y: number, z: number): Matrix4 => [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1];
const stretch = (x: number, y = x, z = x): Matrix4 => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
const turn = (angle: number): Matrix4 => {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
};
const all = (...matrices: Matrix4[]): Matrix4 => matrices.reduce((a, b) => multiply(a, b));

const SHAPES = {
  box: (size: number): SplatCut => ({
    shape: 'box',
    side: 'outside',
    opacity: 0,
    shapeToWorld: all(turn(0.4), stretch(1.2 * size, size, 1.4 * size)),
  }),
  sphere: (size: number): SplatCut => ({
    ...{ shape: 'sphere', color: recolored(2), offset: [0.1 * size, -0.05 * size, 0] },
    shapeToWorld: all(move(0.2 * size, 0, 0), stretch(1.3 * size, 0.9 * size, size)),
  }),
  cylinder: (size: number): SplatCut => ({
    ...{ shape: 'cylinder', surfaceOpacity: 0.3, color: tinted([1, 0.4, 0.3], 0.8) },
    shapeToWorld: all(turn(-0.3), stretch(size, 1.5 * size, size)),
  }),
  plane: (size: number): SplatCut => ({
    shape: 'plane',
    opacity: 0.2,
    color: lightened(0.5),
    shapeToWorld: all(turn(0.5), move(0, 0.1 * size, 0)),
  }),
};

interface Case {
  readonly name: string;
  readonly cloud: GroupedCloud;
  readonly camera: Camera;
  readonly sceneToWorld?: Matrix4;
  readonly size: number;
}

const blobCamera = cameraAt([2.2, -1.1, -3.4], [0.2, 0, 0], { width: 144, height: 96, near: 0.2 });
const needleScene = needles();

const SCENES: readonly Case[] = [
  {
    name: 'ellipsoids, sheared',
    cloud: blobs(700),
    camera: { ...blobCamera, worldToCamera: lookAt([2.2, -1.1, -3.4], [0.2, 0, 0], UP) },
    sceneToWorld: all(move(0.1, 0, 0), [1, 0.3, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], stretch(0.9)),
    size: 1,
  },
  { name: 'needles', cloud: needleScene.cloud, camera: resized(needleScene.cameras[0], 144), size: 1.5 },
];

async function drawn({ cloud, camera, sceneToWorld }: Case, cuts: readonly SplatCut[]): Promise<Float32Array> {
  const device = await serialDevice();
  const scene = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
  const groups = cloud.groups && {
    ids: Object.keys(cloud.groups).map(Number),
    of: Uint16Array.from(packedOrder(cloud), (i) => cloud.groups![i]),
  };
  const modifier = new SplatModifier(device, await SplatProgram.compile(device, [scene]), groups);
  const world = new World();
  const placement = world.add({ scene, sceneToWorld, modifier });
  modifier.write({ cuts }, placement);
  const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer: 'quads' }) });
  const pixels = await capture(device, viewpoint, { camera });
  viewpoint.destroy();
  modifier.destroy();
  scene.destroy();
  return pixels;
}

for (const scene of SCENES) {
  for (const [shape, make] of someOf(Object.entries(SHAPES), 2)) {
    for (const edge of someOf([undefined, 0.05, 'hard'] as const, 1 + (SCENES.indexOf(scene) % 2))) {
      test(`${scene.name}: ${shape}, edge ${edge ?? 'of the splats'}: 59 dB against the oracle`, async () => {
        const { cloud, camera, sceneToWorld, size } = scene;
        const cut = { ...make(size), edge: edge === 0.05 ? 0.05 * size : edge };
        const cuts = [cut];
        const pixels = await drawn(scene, cuts);
        const oracle = (own: readonly SplatCut[]): Parameters<typeof closeness>[1] =>
          renderOracleWorld([{ cloud, mode: 'classic', sceneToWorld, cuts: own }], camera, { rules: 'gsplat' });
        const { psnr } = closeness(pixels, oracle(cuts));
        const uncut = closeness(pixels, oracle([])).psnr;
        console.log(`${scene.name}, ${shape}, ${edge ?? 'soft'}: ${psnr.toFixed(1)} dB (${uncut.toFixed(1)} dB uncut)`);
        assert.ok(psnr >= 59, `${psnr} dB`);
        assert.ok(uncut < psnr - 20, 'the cut is seen');
      });
    }
  }
}

test('cuts are limited to groups, of which there may be more than a row of the texture', async () => {
  const [scene] = SCENES;
  const { camera, sceneToWorld } = scene;
  const whole = blobs(4200);
  // Splats are grouped by their index in the file, which packing changes; each of the last 2,100 is a group.
  const groups = Array.from({ length: whole.count }, (_, i) => (i < 2100 ? i % 3 : i));
  const cloud: GroupedCloud = { ...whole, scales: whole.scales.map((scale) => scale / 2), groups };
  const everywhere = { shape: 'everywhere', shapeToWorld: stretch(1) } as const;
  const cuts: SplatCut[] = [
    { ...everywhere, groups: [1], opacity: 0 },
    { ...SHAPES.sphere(1), groups: [0, 2] },
    { ...everywhere, groups: [0, 1, 2], side: 'outside', color: tinted([0.2, 1, 0.4], 1) },
    { ...everywhere, groups: [2101, 4199, 3000], opacity: 0 },
    SHAPES.plane(1),
  ];
  const oracle = renderOracleWorld([{ cloud, mode: 'classic', sceneToWorld, cuts }], camera, { rules: 'gsplat' });
  const pixels = await drawn({ ...scene, cloud }, cuts);
  const { psnr } = closeness(pixels, oracle);
  console.log(`groups: ${psnr.toFixed(1)} dB`);
  assert.ok(psnr >= 59, `${psnr} dB`);
  const ungrouped = { ...cloud, groups: groups.map((id) => (id + 1) % 3) };
  const other = renderOracleWorld([{ cloud: ungrouped, mode: 'classic', sceneToWorld, cuts }], camera, {
    rules: 'gsplat',
  });
  assert.ok(closeness(pixels, other).psnr < psnr - 20, 'other groups give another image');
});

test('several cuts act one after the other, and a modifier without any leaves the frame as it is', async () => {
  const [scene] = SCENES;
  const { cloud, camera, sceneToWorld } = scene;
  const cuts = [SHAPES.cylinder(1), { ...SHAPES.plane(1), opacity: 0 }, SHAPES.sphere(0.7)];
  const oracle = renderOracleWorld([{ cloud, mode: 'classic', sceneToWorld, cuts }], camera, { rules: 'gsplat' });
  const { psnr } = closeness(await drawn(scene, cuts), oracle);
  console.log(`three cuts: ${psnr.toFixed(1)} dB`);
  assert.ok(psnr >= 59, `${psnr} dB`);
  const device = await serialDevice();
  const buffers = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
  const world = new World();
  world.add({ scene: buffers, sceneToWorld });
  const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer: 'quads' }) });
  const plain = await capture(device, viewpoint, { camera });
  assert.ok(psnrOf(plain, await drawn(scene, [])) > 90);
  viewpoint.destroy();
  buffers.destroy();
});

test('a splat across a plane is trimmed to what lies above it; a shape without a volume changes nothing', () => {
  const one: GaussianCloud = {
    ...blobs(1),
    positions: Float32Array.of(0, 0, 0),
    scales: Float32Array.of(0.1, 0.1, 0.1),
  };
  const plane: SplatCut = { shape: 'plane', shapeToWorld: stretch(1), opacity: 0 };
  const { cloud } = cutCloud(one, [plane]);
  // Mean and variance of half of a normal distribution.
  const [mean, variance] = [Math.sqrt(2 / Math.PI), 1 - 2 / Math.PI];
  assert.ok(Math.abs(cloud.positions[1] - 0.1 * mean) < 1e-6, `${cloud.positions[1]}`);
  const found = cloud.axes![0].map((row) => row.reduce((sum, value) => sum + value * value, 0));
  assert.ok(Math.abs(found[1] - 0.01 * variance) < 1e-8 && Math.abs(found[0] - 0.01) < 1e-8, found.join());
  const left = cloud.opacities[0] / one.opacities[0];
  assert.ok(Math.abs(left - 0.5 / Math.sqrt(variance)) < 1e-6, `${left}`);
  assert.ok(Math.abs(normalBelow(1) - 0.8413447460685429) < 1e-12);
});
