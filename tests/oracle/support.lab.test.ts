/** The measures and scenes that other tests rely on. */
import { strict as assert } from 'node:assert';
import { test } from 'node:test';
import { isUsable, keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { differences, maxAbs, percentile, psnr, shareAbove } from '../support/metrics.js';
import { readPng, writePng } from '../support/png.js';
import {
  brightColors,
  edgeOnDiscs,
  equalDepthPlane,
  hugeSplats,
  needles,
  offCenter,
  OPACITY_STEPS,
  opacitySteps,
} from '../support/scenes.js';
import { pixelSplats, proceduralScenes, room, withHostileSplats, type Scene } from '../support/scenes.js';
import { renderOracle, type OracleImage } from './oracle.js';
import { projectEllipse, toCamera, worldPosition, type Ellipse } from './projection.js';
import { RULES } from './rules.js';

test('psnr, largest difference, percentile and share on numbers worked out by hand', () => {
  const [a, b] = [
    [0, 0, 0, 0.5, 0.5, 0.5],
    [0.1, 0, 0, 0.5, 0.5, 0.3],
  ];
  assert.ok(Math.abs(psnr(a, b) - 10 * Math.log10(6 / (0.01 + 0.04))) < 1e-12);
  assert.ok(Math.abs(maxAbs(a, b) - 0.2) < 1e-15);
  assert.equal(psnr(a, a), Infinity);
  assert.ok(Math.abs(psnr(a, b, { mask: [1, 0] }) - 10 * Math.log10(3 / 0.01)) < 1e-12);
  assert.equal(percentile(a, b, 0.5), 0);
  assert.ok(Math.abs(percentile(a, b, 5 / 6) - 0.1) < 1e-15);
  assert.ok(Math.abs(shareAbove(a, b, 0.15) - 1 / 6) < 1e-15);
});

test('clamping forgives what an 8-bit image cannot show, and only that', () => {
  assert.equal(maxAbs([1.5, -0.5, 0.5], [1, 0, 0.5], { clamp: true }), 0);
  assert.equal(maxAbs([1.5, -0.5, 0.5], [1, 0, 0.5]), 0.5);
});

test('NaN and infinities are infinitely wrong, never equal', () => {
  assert.equal(maxAbs([NaN, 0, 0], [NaN, 0, 0]), Infinity);
  assert.equal(maxAbs([Infinity, 0, 0], [Infinity, 0, 0], { clamp: true }), Infinity);
  assert.equal(psnr([NaN, 0, 0], [0, 0, 0]), -Infinity);
});

test('images that cannot be compared are refused', () => {
  assert.throws(() => differences([1], [1, 2]), RangeError);
  assert.throws(() => differences([1, 2, 3], [1, 2, 3], { mask: [0] }), RangeError);
  assert.throws(() => differences([1, 2, 3], [1, 2, 3], { mask: [1, 1] }), RangeError);
});

test('an 8-bit PNG keeps all 256 levels, clamps, and rounds to the nearest', () => {
  const color = Float64Array.from({ length: 3 * 256 }, (_, i) => Math.floor(i / 3) / 255);
  const alpha = Float64Array.from({ length: 256 }, (_, i) => (255 - i) / 255);
  const back = readPng(writePng({ width: 16, height: 16, color, alpha }));
  assert.deepEqual([back.width, back.height], [16, 16]);
  assert.equal(maxAbs(back.color, color), 0);
  assert.equal(maxAbs(back.alpha, alpha, { channels: 1 }), 0);
  const rounded = readPng(writePng({ width: 1, height: 1, color: Float64Array.of(1.7, -0.2, 0.4999 / 255) }));
  assert.deepEqual([...rounded.color, ...rounded.alpha], [1, 0, 0, 1]);
  assert.equal(
    readPng(writePng({ width: 1, height: 1, color: Float64Array.of(0, 0, 0.5001 / 255) })).color[2],
    1 / 255,
  );
});

const render = (scene: Scene, view = 0): OracleImage =>
  renderOracle(scene.cloud, scene.cameras[view], { rules: 'gsplat', mode: 'classic' });

const ellipsesOf = ({ cloud, cameras: [camera] }: Scene): Ellipse[] =>
  Array.from({ length: cloud.count }, (_, i) => toCamera(camera, worldPosition(cloud, i)))
    .map((center, i) => ({ center, i }))
    .filter(({ center }) => center[2] >= camera.near)
    .map(({ center, i }) => projectEllipse(cloud, i, camera, center, RULES.gsplat));

const largest = (values: ArrayLike<number>): number =>
  Array.prototype.reduce.call(values, (a, b) => Math.max(Number(a), Number(b)), -Infinity) as number;
const mean = (values: Uint32Array): number => values.reduce((a, b) => a + b, 0) / values.length;

test('every scene is the same each time it is made, usable throughout, and drawn by the oracle', () => {
  for (const make of proceduralScenes) {
    const scene = make();
    assert.equal(scene.name, make.name);
    assert.deepEqual(make().cloud, scene.cloud);
    assert.ok(Array.from({ length: scene.cloud.count }, (_, i) => isUsable(scene.cloud, i)).every(Boolean), scene.name);
    scene.cameras.forEach((camera, view) => {
      assert.ok(camera.width >= 320 && camera.width <= 480 && camera.height >= 240 && camera.height <= 360, scene.name);
      const image = render(scene, view);
      assert.ok(image.color.every(Number.isFinite), scene.name);
      assert.ok(mean(image.contributors) > 2, `${scene.name} draws ${mean(image.contributors)} splats to a pixel`);
      assert.ok(image.maxWeight.filter((w) => w > 1 / 255).length > 300, `${scene.name} shows too few splats`);
    });
  }
});

test('each scene has in it what it is named for', () => {
  const inRoom = render(room());
  assert.ok(mean(inRoom.contributors) > 80 && inRoom.transmittance.every((t) => t < 0.9), 'room: deep, and everywhere');

  const thin = ellipsesOf(needles()).map(({ covariance: { xx, xy, yy } }) => {
    const middle = (xx + yy) / 2;
    const spread = Math.sqrt(middle ** 2 - (xx * yy - xy ** 2));
    return Math.sqrt(middle + spread);
  });
  assert.ok(
    largest(thin) > 150 && thin.filter((s) => s < 1).length > 100,
    'needles: across the screen and below a pixel',
  );

  const huge = ellipsesOf(hugeSplats()).filter(({ covariance }) => Math.sqrt(covariance.xx) > 360);
  assert.ok(huge.length > 100, `hugeSplats: ${huge.length} with a standard deviation wider than the view`);

  const pixels = ellipsesOf(pixelSplats()).filter(({ covariance }) => covariance.xx < 0.3 + 1);
  assert.ok(pixels.length > 50_000, `pixelSplats: ${pixels.length} of a pixel or less`);

  const steps = render(opacitySteps());
  assert.equal(opacitySteps().cloud.opacities.filter((o) => o === 0 || o === 1).length, 2 * 210);
  assert.ok(largest(steps.contributors) >= 20, 'opacitySteps: as deep as its last row');
  const stopped = steps.transmittance.filter((t) => t > 1e-4 && t < 1e-3).length;
  assert.ok(OPACITY_STEPS.length > 30 && stopped > 1000, `opacitySteps: ${stopped} pixels finished early`);

  const bright = render(brightColors()).color;
  assert.ok(largest(bright) > 3 && bright.some((c) => c === 0), `brightColors: up to ${largest(bright)}`);

  const discs = edgeOnDiscs();
  const lines = ellipsesOf(discs).filter(({ covariance }) => covariance.yy < 0.3 + 1e-9);
  assert.ok(lines.length >= 1000, `edgeOnDiscs: ${lines.length} lines`);

  const plane = equalDepthPlane();
  const depths = new Set(
    Array.from({ length: plane.cloud.count }, (_, i) => toCamera(plane.cameras[0], worldPosition(plane.cloud, i))[2]),
  );
  assert.deepEqual([plane.cloud.count, depths.size], [100_000, 1]);

  assert.ok(
    offCenter().cameras.some(({ cx, width }) => cx < 0 || cx > width),
    'offCenter: principal point outside the image',
  );
});

test('hostile splats: the good ones are all there in order, every bad one is bad, every fault occurs', () => {
  for (const make of [brightColors, opacitySteps]) {
    const original = make().cloud;
    const { cloud, good, bad } = withHostileSplats(original);
    assert.equal(cloud.count, good.length + bad.length);
    assert.equal(good.length, original.count);
    assert.deepEqual([bad[0].index, bad[bad.length - 1].index], [0, cloud.count - 1]);
    for (const { index, fault } of bad) assert.ok(!isUsable(cloud, index), `${fault} at ${index} passes for usable`);
    assert.ok(good.every((i) => isUsable(cloud, i)));
    const faults = new Set(bad.map(({ fault }) => fault.replace(/\[\d+\]/, '')));
    for (const attribute of ['positions', 'scales', 'rotations', 'opacities', 'sh']) {
      for (const value of ['NaN', 'Infinity', '-Infinity'])
        assert.ok(faults.has(`${attribute} = ${value}`), `${attribute} ${value}`);
    }
    assert.ok(['rotation 0', 'scale 1e-30', 'scale 1e30'].every((fault) => faults.has(fault)));
    const kept = keepUsable(cloud);
    assert.equal(kept.droppedCount, bad.length);
    const arrays: (keyof GaussianCloud)[] = ['positions', 'scales', 'opacities', 'sh'];
    for (const name of arrays) assert.deepEqual(kept[name], original[name], name);
  }
});
