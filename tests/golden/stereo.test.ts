/** Both eyes of a headset in rectangles of one texture, or in layers of one, by one cull and one sort, against the oracle of each eye's camera. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { cameraFromProjection, multiply, type Camera } from '@gaussian-splat/core';
import {
  GaussianBuffers,
  packGaussians,
  settings,
  Stereo,
  Viewpoint,
  World,
  type RasterizerName,
  type RectangleBounds,
  type StereoView,
} from '@gaussian-splat/renderer';
import { renderOracle } from '../oracle/oracle.js';
import { closeness } from '../support/compare.js';
import { onlyInLab } from '../support/extent.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { notePasses } from '../support/passes.js';
import { readTexture } from '../support/read-frame.js';
import { room, thinned } from '../support/scenes.js';

const MIN_DB = 59;
after(endNodeDevice);

const {
  cloud,
  cameras: [head],
} = thinned(room(), 4000);

const [WIDTH, HEIGHT] = [96, 72];
const FORMAT = 'rgba32float';
/** Distance between the eyes, and the near plane. */
const [APART, NEAR] = [0.063, 0.05];

/** A camera of off-center projection: degrees to the left, right, up and down. */
function eyeAt(side: -1 | 1, { width = WIDTH, height = HEIGHT, turn = 0 } = {}): Camera {
  const [inner, outer] = [42, 52];
  const angles = side < 0 ? [outer, inner, 46, 50] : [inner, outer, 46, 50];
  const [l, r, u, d] = angles.map((angle) => Math.tan((angle * Math.PI) / 180));
  const n = NEAR;
  const projection = [
    2 / (l + r),
    0,
    0,
    0,
    0,
    2 / (u + d),
    0,
    0,
    (r - l) / (r + l),
    (u - d) / (u + d),
    -1,
    -1,
    0,
    0,
    -n,
  ];
  const camera = cameraFromProjection([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], [...projection, 0], {
    width,
    height,
  });
  const [sin, cos] = [Math.sin(turn * side), Math.cos(turn * side)];
  const aside = [cos, 0, sin, (-side * APART) / 2, 0, 1, 0, 0, -sin, 0, cos, 0, 0, 0, 0, 1];
  return { ...camera, worldToCamera: multiply(aside, head.worldToCamera) };
}

type Place = (side: -1 | 1) => { readonly bounds: RectangleBounds; readonly layer: number };

interface Case {
  readonly name: string;
  readonly size: [width: number, height: number, layers: number];
  readonly place: Place;
  readonly turn?: number;
  readonly rasterizer?: RasterizerName;
  readonly sorts: number;
}

const beside: Place = (side) => ({ bounds: { x: side < 0 ? 0 : WIDTH, y: 0, width: WIDTH, height: HEIGHT }, layer: 0 });
const layered: Place = (side) => ({
  bounds: { x: 0, y: 0, width: WIDTH, height: HEIGHT },
  layer: side < 0 ? 0 : 1,
});
/** Views of 0.7 of the size, in the corners that a headset chooses. */
const smaller: Place = (side) => ({
  bounds: { x: side < 0 ? 5 : WIDTH, y: 9, width: Math.round(0.7 * WIDTH), height: Math.round(0.7 * HEIGHT) },
  layer: 0,
});

const cases: readonly Case[] = [
  { name: 'side by side', size: [2 * WIDTH, HEIGHT, 1], place: beside, sorts: 1 },
  { name: 'in layers', size: [WIDTH, HEIGHT, 2], place: layered, sorts: 1 },
  { name: 'in viewports of 0.7', size: [2 * WIDTH, HEIGHT, 1], place: smaller, sorts: 1 },
  { name: 'by tiles', size: [2 * WIDTH, HEIGHT, 1], place: beside, rasterizer: 'tiles', sorts: 1 },
  { name: 'on canted displays', size: [2 * WIDTH, HEIGHT, 1], place: beside, turn: 0.05, sorts: 2 },
];

for (const { name, size, place, turn, rasterizer = 'quads', sorts } of cases) {
  test(
    `both eyes ${name} are those of the oracle, with ${sorts} ${sorts === 1 ? 'sort' : 'sorts'}`,
    { skip: rasterizer === 'tiles' && onlyInLab },
    async (t) => {
      const device = await serialDevice();
      const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
      const world = new World();
      world.add({ scene });
      const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer }) });
      const stereo = new Stereo(device);
      const target = device.createTexture({ size, format: FORMAT, usage: 0x10 | 0x1 });
      const views = ([-1, 1] as const).map((side): StereoView => {
        const { bounds, layer } = place(side);
        const view = target.createView({ dimension: '2d', baseArrayLayer: layer, arrayLayerCount: 1 });
        return { camera: eyeAt(side, { ...bounds, turn }), target: { view, format: FORMAT }, bounds };
      });
      device.pushErrorScope('validation');
      const passes = notePasses(device);
      stereo.draw(viewpoint, views);
      passes.stop();
      assert.equal(passes.labels.filter((label) => label === 'gs.sort').length, sorts);
      assert.equal(await viewpoint.isComplete(), true);
      assert.equal((await device.popErrorScope())?.message, undefined);
      for (const [i, side] of ([-1, 1] as const).entries()) {
        const { bounds, layer } = place(side);
        const oracle = renderOracle(cloud, views[i].camera, { rules: 'gsplat', mode: 'classic' });
        const found = closeness(await readRectangle(device, target, bounds, layer), oracle);
        t.diagnostic(`${side < 0 ? 'left' : 'right'} eye: ${found.psnr.toFixed(1)} dB`);
        assert.ok(found.psnr >= MIN_DB, `${side < 0 ? 'left' : 'right'} eye: ${found.psnr.toFixed(1)} dB`);
      }
      stereo.destroy();
      viewpoint.destroy();
      scene.destroy();
      target.destroy();
    },
  );
}

test('at fewer pixels each eye is the image of a viewpoint of its own', async () => {
  const device = await serialDevice();
  const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
  const world = new World();
  world.add({ scene });
  const viewpoint = new Viewpoint(device, world);
  const stereo = new Stereo(device);
  const make = (width: number): GPUTexture =>
    device.createTexture({ size: [width, HEIGHT], format: FORMAT, usage: 0x10 | 0x1 });
  const [target, alone] = [make(2 * WIDTH), make(WIDTH)];
  const fewer = settings('default', { resolutionScale: 0.7 });
  const sides = [-1, 1] as const;
  const views = sides.map((side): StereoView => {
    const { bounds } = beside(side);
    return { camera: eyeAt(side), target: { view: target.createView(), format: FORMAT }, bounds };
  });
  stereo.draw(viewpoint, views, { background: [0.1, 0.1, 0.11, 1] }, fewer);
  const found = await Promise.all(sides.map((side) => readRectangle(device, target, beside(side).bounds, 0)));
  for (const [i, { camera }] of views.entries()) {
    viewpoint.draw(camera, { target: alone, background: [0.1, 0.1, 0.11, 1] }, fewer);
    const decibels = psnr(found[i], await readTexture(device, alone), { channels: 4 });
    assert.ok(decibels > 80, `${decibels.toFixed(1)} dB`);
  }
  stereo.destroy();
  viewpoint.destroy();
  scene.destroy();
  for (const texture of [target, alone]) texture.destroy();
});

async function readRectangle(
  device: GPUDevice,
  texture: GPUTexture,
  { x, y, width, height }: RectangleBounds,
  layer: number,
): Promise<Float32Array> {
  const own = device.createTexture({ size: [width, height], format: FORMAT, usage: 0x1 | 0x2 });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToTexture({ texture, origin: [x, y, layer] }, { texture: own }, [width, height]);
  device.queue.submit([encoder.finish()]);
  const numbers = Float32Array.from(await readTexture(device, own));
  own.destroy();
  return numbers;
}
