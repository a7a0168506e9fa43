/** Depth and identity of each pixel, against the float64 oracle. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, test } from 'node:test';
import {
  cameraFromCalibration,
  cross,
  multiply,
  normalize,
  scale,
  type CalibratedView,
  type Camera,
  type GaussianCloud,
  type Matrix4,
  type Vector3,
} from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import {
  capture,
  GaussianBuffers,
  packGaussians,
  Viewpoint,
  World,
  type ViewpointOptions,
} from '@gaussian-splat/renderer';
import { renderDepth, renderFisheye } from '@gaussian-splat/renderer/depth';
import { densestDepth } from '../oracle/densest.js';
import { renderOracle, renderOracleWorld, type PlacedCloud } from '../oracle/oracle.js';
import { projectEllipse, toCamera, worldPosition } from '../oracle/projection.js';
import { RULES } from '../oracle/rules.js';
import { cloudOf, repeat } from '../support/clouds.js';
import { isLab, onlyInLab, someOf } from '../support/extent.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { seededRandom } from '../support/random.js';
import { cameraAt, resized, room, thinned } from '../support/scenes.js';
import { pebbles } from '../support/scenes/pebbles.js';

const SCENES = new URL('../../demo/scenes/', import.meta.url);

/** Largest difference of depths, world units: 1 cm if a unit is a meter. */
const LIMIT = 0.01;
/** How many times smaller the images of `npm test` are than those of the laboratory. */
const SMALLER = isLab ? 1 : 3.2;
const width = (pixels: number): number => Math.round(pixels / SMALLER);

/** Minimum coverage of compared depths. */
const COVERED = 0.9;

/** The images of both of a world. */
async function measure(placed: readonly PlacedCloud[], camera: Camera) {
  const device = await serialDevice();
  const world = new World();
  const scenes = [];
  for (const { cloud, mode, sceneToWorld, opacity } of placed) {
    const packed = packGaussians({ ...cloud, antialiased: mode === 'antialiased' });
    scenes.push(await GaussianBuffers.upload(device, packed));
    world.add({ scene: scenes.at(-1)!, sceneToWorld, opacity });
  }
  const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: 'tiles' } });
  const image = await renderDepth(device, viewpoint, { camera });
  const plain = await capture(device, viewpoint, { camera });
  for (const owned of [viewpoint, ...scenes]) owned.destroy();
  const oracle = renderOracleWorld(placed, camera, { rules: 'gsplat', measuresDepths: true });
  assert.equal(Buffer.compare(Buffer.from(image.color.buffer), Buffer.from(plain.buffer)), 0, 'the image changed');
  return { image, oracle, ...compared(image, oracle) };
}

type Measured = Awaited<ReturnType<typeof renderDepth>>;
type Oracle = ReturnType<typeof renderOracleWorld>;

/** Fractions of the pixels with a coverage above COVERED whose depths are within LIMIT, and of those whose ids are right. */
function compared(image: Measured, { transmittance, depths }: Oracle) {
  const covered = [...transmittance.keys()].filter((pixel) => transmittance[pixel] < 1 - COVERED);
  const share = (isRight: (pixel: number) => boolean, of = covered): number => of.filter(isRight).length / of.length;
  const near = (own: Float32Array, exact: Float64Array): number =>
    share((pixel) => Math.abs(own[pixel] - exact[pixel]) <= LIMIT);
  const seen = [...transmittance.keys()].filter((pixel) => depths!.ids[pixel] > 0);
  return {
    pixels: covered.length,
    expected: near(image.expectedDepth, depths!.expected),
    median: near(image.depth, depths!.median),
    ids: share((pixel) => image.ids[pixel] === depths!.ids[pixel], seen),
    coverage: Math.max(...transmittance.map((light, pixel) => Math.abs(image.coverage[pixel] - (1 - light)))),
  };
}

function assertRight(name: string, found: Awaited<ReturnType<typeof measure>>): void {
  const { pixels, expected, median, ids, coverage } = found;
  const percent = (share: number): string => `${(100 * share).toFixed(2)} %`;
  console.log(
    `${name}: ${pixels} pixels, expected ${percent(expected)}, median ${percent(median)}, ids ${percent(ids)}, ` +
      `coverage within ${coverage.toFixed(4)}`,
  );
  assert.ok(pixels > 12_500 / SMALLER ** 2, `${name}: ${pixels} covered pixels`);
  assert.ok(expected >= 0.99, `${name}: expected depth ${percent(expected)}`);
  assert.ok(median >= 0.99, `${name}: median depth ${percent(median)}`);
  assert.ok(ids >= 0.999, `${name}: ids ${percent(ids)}`);
  assert.ok(coverage < 0.01, `${name}: coverage ${coverage}`);
}

const placed = (cloud: GaussianCloud, sceneToWorld?: Matrix4): PlacedCloud => ({
  cloud,
  mode: 'classic',
  sceneToWorld,
});

test('a room: depths to a centimeter', { skip: onlyInLab }, async () => {
  const { cloud, cameras } = room();
  assertRight('room', await measure([placed(cloud)], resized(cameras[0], width(320))));
});

test('the skull: depths to a centimeter', { skip: onlyInLab }, async () => {
  const bytes = readFileSync(new URL('skull.spz', SCENES));
  const view = JSON.parse(readFileSync(new URL('skull-camera.json', SCENES), 'utf8')) as CalibratedView;
  const cloud = await readScene(new Uint8Array(bytes), { name: 'skull.spz' });
  assertRight('skull', await measure([placed(cloud)], resized(cameraFromCalibration(view), width(320))));
});

test('scenes that interpenetrate: the id is that of the scene with the largest sum of weights', async () => {
  const { cloud, cameras } = room();
  const half = thinned(room(), cloud.count / 2).cloud;
  const moved = [1, 0, 0, 0.4, 0, 1, 0, 0.1, 0, 0, 1, -0.3, 0, 0, 0, 1];
  const scenes = [placed(half), placed(half, moved), placed(pebbles(24_000))];
  const found = await measure(scenes, resized(cameras[0], width(240)));
  assertRight('three scenes', found);
  const counts = [1, 2, 3].map((id) => found.image.ids.filter((own) => own === id).length);
  assert.ok(Math.min(...counts) > 2_500 / SMALLER ** 2, `pixels of each scene: ${counts.join(', ')}`);
});

test('parallel rays', { skip: onlyInLab }, async () => {
  const { cloud } = room();
  const camera = cameraAt([-2.2, -0.1, -6], [0, 0.3, 1.6], { width: 240, height: 160, fovXDegrees: 60 });
  const orthographic = { ...camera, orthographic: true, fx: 40, fy: 40 };
  assertRight('orthographic', await measure([placed(cloud)], resized(orthographic, width(240))));
});

test('twelve scenes at one place: the ids of all pixels have exact sums', async () => {
  const { cloud, cameras } = thinned(room(), 12_000);
  const scenes = Array.from({ length: 12 }, (_, k) => {
    const own = thinned({ name: '', cloud, cameras }, 1_000 + 10 * k).cloud;
    return placed(own, [1, 0, 0, 0.05 * k, 0, 1, 0, 0.03 * k, 0, 0, 1, 0, 0, 0, 0, 1]);
  });
  const { ids } = await measure(scenes, resized(cameras[0], width(160)));
  console.log(`twelve scenes: ids ${(100 * ids).toFixed(2)} %`);
  assert.ok(ids >= 0.999, `ids of twelve scenes: ${ids}`);
});

test('the drawn size of a splat in view gives its densest depth on a ray', () => {
  const { cloud, cameras } = room();
  const camera = cameras[0];
  for (let i = 0, seen = 0; seen < 200; i++) {
    const center = toCamera(camera, worldPosition(cloud, i));
    const ellipse = projectEllipse(cloud, i, camera, center, RULES.gsplat);
    if (center[2] < 1 || Math.abs(ellipse.x - 240) > 240 || Math.abs(ellipse.y - 160) > 160) continue;
    seen++;
    const [exact, drawn] = [undefined, ellipse].map((own) => densestDepth(cloud, i, camera, center, RULES.gsplat, own));
    for (const offset of [-3, 0, 9]) {
      const [column, row] = [Math.floor(ellipse.x) + offset, Math.floor(ellipse.y) + 1];
      assert.ok(Math.abs(exact(column, row) / drawn(column, row) - 1) < 1e-6, `splat ${i}`);
    }
  }
});

test('quads and an order for each pixel are refused by name', async () => {
  const device = await serialDevice();
  const world = new World();
  const camera = resized(room().cameras[0], 16);
  const refused = async (options: ViewpointOptions, error: object): Promise<void> => {
    const viewpoint = new Viewpoint(device, world, options);
    await assert.rejects(() => renderDepth(device, viewpoint, { camera }), error);
    viewpoint.destroy();
  };
  const where = 'FrameTarget.auxiliary';
  await refused({ settings: { rasterizer: 'quads' } }, { code: 'unsupported/limits', where });
  await refused({ settings: { rasterizer: 'tiles', order: 'pixel' } }, { code: 'argument/value', where });
});

/**
 * Returns the oracle's pixel along one ray: the middle of a pinhole camera that looks along it, with the angle of a pixel of the lens. Splats are ordered by distance.
 */
function alongRay(cloud: GaussianCloud, camera: Camera, ray: Vector3): Oracle {
  const helper: Vector3 = Math.abs(ray[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const right = normalize(cross(helper, ray));
  const turn = [...right, 0, ...cross(ray, right), 0, ...ray, 0, 0, 0, 0, 1];
  const worldToCamera = multiply(turn, camera.worldToCamera);
  const pixel: Camera = { ...camera, width: 1, height: 1, cx: 0.5, cy: 0.5, worldToCamera };
  const depthKeys = Array.from({ length: cloud.count }, (_, i) =>
    Math.hypot(...toCamera(pixel, worldPosition(cloud, i))),
  );
  // Splats beyond 1.3 of the half field of view of a face, which is 1, are moved there.
  const rules = { ...RULES.gsplat, jacobianMargin: 1.3 * 2 * camera.fx };
  return renderOracle(cloud, pixel, { rules, mode: 'classic', depthKeys, measuresDepths: true });
}

test('a fisheye lens of 190 degrees: each pixel is that of a pinhole camera along its ray', async () => {
  const device = await serialDevice();
  // Splats of many pixels around the camera: the filter of a face is that of its own, smaller pixels.
  const smaller = isLab ? 1 : 2;
  const random = seededRandom(76);
  const around = repeat(5_000, () => ({
    position: scale(random.direction(), random.uniform(3, 6)),
    scale: [0, 0, 0].map(() => random.uniform(0.1, 0.25)) as unknown as Vector3,
    rotation: random.rotation(),
    opacity: random.uniform(0.3, 1),
    color: [0, 0, 0].map(() => random.uniform(0, 1)) as unknown as Vector3,
  }));
  const cloud = cloudOf(around, 0);
  const world = new World();
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  world.add({ scene: gaussians });
  const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: 'tiles' } });
  const [side, focal] = [220 / smaller, 60 / smaller];
  const middle = side / 2;
  const { worldToCamera, near, far } = cameraAt([0, 0, 0], [1, 0.2, 0.5]);
  const lens = { width: side, height: side, fx: focal, fy: focal, cx: middle, cy: middle, worldToCamera, near, far };
  // r(θ) as cv2.fisheye.projectPoints has it for these coefficients.
  const fisheye = [0.05, -0.01, 0.003, -0.0004];
  const image = await renderFisheye(device, viewpoint, { camera: { ...lens, fisheye } });
  const radiusAt = (a: number): number => a + fisheye.reduce((sum, k, i) => sum + k * a ** (2 * i + 3), 0);
  const [colors, depths]: [number[], number[]] = [[], []];
  let ids = 0;
  for (let angle = 0.02; angle < 1.65; angle += isLab ? 0.2 : 0.4) {
    for (const turn of someOf([0.3, 2.9, 4.2, 5.5], 2)) {
      const radius = focal * radiusAt(angle);
      const [column, row] = [middle + radius * Math.cos(turn), middle + radius * Math.sin(turn)].map(Math.floor);
      // The ray of the pixel's center, by bisection.
      const [x, y] = [(column + 0.5 - middle) / focal, (row + 0.5 - middle) / focal];
      let [low, high] = [0, Math.PI];
      for (let k = 0; k < 60; k++) {
        const between = (low + high) / 2;
        if (radiusAt(between) < Math.hypot(x, y)) low = between;
        else high = between;
      }
      const sine = Math.sin(low) / Math.hypot(x, y);
      const found = alongRay(cloud, lens, [sine * x, sine * y, Math.cos(low)]);
      const pixel = row * side + column;
      for (let k = 0; k < 3; k++) colors.push(Math.abs(image.color[4 * pixel + k] - found.color[k]));
      depths.push(Math.abs(image.depth[pixel] / found.depths!.median[0] - 1));
      if (image.ids[pixel] === found.depths!.ids[0]) ids++;
    }
  }
  for (const list of [colors, depths]) list.sort((a, b) => a - b);
  const at = (list: number[], share: number): number => list[Math.floor(share * (list.length - 1))];
  console.log(
    `fisheye: ${depths.length} rays, ids ${ids}; color half within ${at(colors, 0.5).toFixed(4)}, 90 % ${at(colors, 0.9).toFixed(4)}; ` +
      `depth half within ${(100 * at(depths, 0.5)).toFixed(2)} %, 80 % ${(100 * at(depths, 0.8)).toFixed(2)} %`,
  );
  assert.equal(ids, depths.length, 'ids');
  // Splats are affine images of Gaussians: those of a face differ from those of a camera that looks along the ray, and more
  // so where pixels are larger.
  const [color, depth] = isLab ? [[0.01, 0.03], [0.002, 0.01]] : [[0.02, 0.06], [0.005, 0.08]]; // prettier-ignore
  assert.ok(at(colors, 0.5) < color[0] && at(colors, 0.9) < color[1], 'colors');
  assert.ok(at(depths, 0.5) < depth[0] && at(depths, 0.8) < depth[1], 'depths');
  await assert.rejects(() => renderFisheye(device, viewpoint, { camera: { ...lens, fisheye: [0, 0] } }), {
    code: 'argument/camera',
    where: 'camera.fisheye',
  });
  for (const owned of [viewpoint, gaussians]) owned.destroy();
});

after(endNodeDevice);
