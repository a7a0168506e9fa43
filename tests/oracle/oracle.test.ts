import { strict as assert } from 'node:assert';
import { test } from 'node:test';
import fc from 'fast-check';
import { GaussianSplatError, multiply, type Camera } from '@gaussian-splat/core';
import { cloudOf, repeat, type SplatDescription } from '../support/clouds.js';
import { maxAbs, psnr } from '../support/metrics.js';
import { seededRandom, type Random } from '../support/random.js';
import { cameraAt, movedBy, room } from '../support/scenes.js';
import { renderOracle, toRgba, type OracleOptions } from './oracle.js';
import { RULES } from './rules.js';

/** 32x32 pixels, focal length 32, so that a unit at depth 32 is a pixel; pixel (16, 16) has its center on the axis. */
const camera: Camera = {
  ...cameraAt([0, 0, 0], [0, 0, 1], { width: 32, height: 32, fovXDegrees: 90 }),
  fx: 32,
  fy: 32,
  cx: 16.5,
  cy: 16.5,
};
const classic: OracleOptions = { rules: 'gsplat', mode: 'classic' };
const CENTER = 16 * 32 + 16;

/** A ball of 2 px standard deviation (before dilation) on the axis, by default. */
const ball = (splat: Partial<SplatDescription>): SplatDescription => ({
  position: [0, 0, 32],
  scale: 2,
  opacity: 0.5,
  color: [1, 1, 1],
  ...splat,
});

const close = (found: number, expected: number, what: string, tolerance = 1e-6): void =>
  assert.ok(Math.abs(found - expected) <= tolerance, `${what}: ${found}, expected ${expected}`);

test('one Gaussian has alpha o·exp(-r²/2σ²) at every pixel center, and nothing where that is under 1/255', () => {
  const image = renderOracle(cloudOf([ball({ opacity: 0.75, color: [1, 0.25, 2] })]), camera, classic);
  let drawn = 0;
  for (let row = 0; row < 32; row++) {
    for (let column = 0; column < 32; column++) {
      const alpha = 0.75 * Math.exp(-((column - 16) ** 2 + (row - 16) ** 2) / (2 * 4.3));
      const expected = alpha < 1 / 255 ? 0 : alpha;
      const pixel = 32 * row + column;
      close(1 - image.transmittance[pixel], expected, `alpha at ${column}, ${row}`, 1e-12);
      [1, 0.25, 2].forEach((c, k) =>
        close(image.color[3 * pixel + k], c * expected, `channel ${k} at ${column}, ${row}`),
      );
      assert.equal(image.contributors[pixel], expected ? 1 : 0);
      drawn += expected ? 1 : 0;
    }
  }
  assert.ok(drawn > 100 && drawn < 200, `a disc of radius sqrt(2·4.3·ln(0.75·255)) = 6.7 pixels, found ${drawn}`);
  close(image.maxWeight[0], 0.75, 'largest weight', 1e-12);
});

test('alpha is capped at 0.999 by gsplat and at 0.99 by INRIA', () => {
  const cloud = cloudOf([ball({ opacity: 1 })]);
  close(renderOracle(cloud, camera, classic).transmittance[CENTER], 0.001, 'gsplat', 1e-15);
  close(renderOracle(cloud, camera, { rules: 'inria', mode: 'classic' }).transmittance[CENTER], 0.01, 'inria', 1e-15);
});

test('an opacity just under 1/255 draws nothing, just over it one pixel', () => {
  const contributors = (opacity: number): number =>
    renderOracle(cloudOf([ball({ opacity })]), camera, classic).contributors.reduce((a, b) => a + b, 0);
  assert.equal(contributors(0.99999 / 255), 0);
  assert.equal(contributors(1.00001 / 255), 1);
});

test('nearer splats cover farther ones, in any order of the cloud', () => {
  const layers = [
    ball({ position: [0, 0, 31], opacity: 0.5, color: [1, 0, 0] }),
    ball({ position: [0, 0, 32], opacity: 0.25, color: [0, 1, 0] }),
    ball({ position: [0, 0, 33], opacity: 0.8, color: [0, 0, 1] }),
  ];
  for (const order of [
    [0, 1, 2],
    [2, 1, 0],
    [1, 2, 0],
  ]) {
    const image = renderOracle(cloudOf(order.map((i) => layers[i])), camera, { ...classic, background: [1, 1, 1] });
    const remaining = 0.5 * 0.75 * 0.2;
    [0.5, 0.5 * 0.25, 0.5 * 0.75 * 0.8].forEach((c, k) =>
      close(image.color[3 * CENTER + k], c + remaining, `${order} ${k}`),
    );
    close(image.transmittance[CENTER], remaining, 'transmittance');
    assert.equal(image.contributors[CENTER], 3);
  }
});

test('equal depths are blended in the order of the cloud, unless the caller gives keys', () => {
  const cloud = cloudOf([ball({ color: [1, 0, 0] }), ball({ color: [0, 1, 0] })]);
  const center = (options: OracleOptions): number[] => [
    ...renderOracle(cloud, camera, options).color.subarray(3 * CENTER, 3 * CENTER + 2),
  ];
  close(center(classic)[0], 0.5, 'red first');
  close(center(classic)[1], 0.25, 'green second');
  close(center({ ...classic, depthKeys: [7, 3] })[0], 0.25, 'red second');
  close(center({ ...classic, depthKeys: [7, 3] })[1], 0.5, 'green first');
});

test('depth is compared in float32, as renderers do', () => {
  // 32 + 1e-8 is 32 in float32: a tie, so that the order of the cloud decides although the second is nearer.
  const tilted: Camera = { ...camera, worldToCamera: [1, 0, 0, 0, 0, 1, 0, 0, -1e-8, 0, 1, 0, 0, 0, 0, 1] };
  const cloud = cloudOf([ball({ color: [1, 0, 0] }), ball({ position: [1, 0, 32], color: [0, 1, 0] })]);
  const image = renderOracle(cloud, tilted, classic);
  close(image.maxWeight[0], 0.5, 'the first splat is not covered', 1e-7);
});

test('a pixel is finished before its transmittance falls under 1e-4, and stays so', () => {
  const halves = repeat(20, (i) => ball({ position: [0, 0, 32 + i / 1e3], opacity: 0.5 }));
  const faint = ball({ position: [0, 0, 40], opacity: 0.01 });
  for (const rules of ['gsplat', 'inria'] as const) {
    const image = renderOracle(cloudOf([...halves, faint]), camera, { rules, mode: 'classic' });
    assert.equal(image.contributors[CENTER], 13); // 2^-13 = 1.2e-4, 2^-14 = 6.1e-5
    close(image.transmittance[CENTER], 2 ** -13, 'transmittance', 1e-12);
    assert.ok(image.maxWeight[20] > 0, 'the faint one is seen beside the finished pixels');
    assert.ok(image.maxWeight[20] < 0.0099, 'but not at the center');
  }
});

test('at exactly the minimum transmittance gsplat stops and INRIA continues', () => {
  const cloud = cloudOf([ball({}), ball({})]);
  for (const [name, contributors] of [
    ['gsplat', 1],
    ['inria', 2],
  ] as const) {
    const image = renderOracle(cloud, camera, { rules: { ...RULES[name], minTransmittance: 0.25 }, mode: 'classic' });
    assert.equal(image.contributors[CENTER], contributors);
  }
});

test('centers before the near plane and beyond the far plane are not drawn; on the near plane gsplat draws', () => {
  const seen = (z: number, rules: 'gsplat' | 'inria'): boolean => {
    const planes = { ...camera, near: 2, far: 8 };
    const image = renderOracle(cloudOf([ball({ position: [0, 0, z], scale: 0.1 })]), planes, {
      rules,
      mode: 'classic',
    });
    return image.contributors[CENTER] === 1;
  };
  assert.deepEqual(
    [1.99, 2, 2.01, 8, 8.01, -4].map((z) => seen(z, 'gsplat')),
    [false, true, true, true, false, false],
  );
  assert.deepEqual(
    [1.99, 2, 2.01, 8, 8.01, -4].map((z) => seen(z, 'inria')),
    [false, false, true, true, false, false],
  );
});

test('antialiased, a splat has the energy that it would have without dilation', () => {
  for (const scale of [0.7, 1, 2]) {
    const image = renderOracle(cloudOf([ball({ scale, opacity: 0.9 })]), camera, {
      rules: 'gsplat',
      mode: 'antialiased',
    });
    const energy = image.transmittance.reduce((sum, t) => sum + 1 - t, 0);
    const [exact, dilated] = [scale ** 2, scale ** 2 + 0.3];
    close(image.transmittance[CENTER], 1 - (0.9 * exact) / dilated, 'center', 1e-7);
    // The whole integral is 2π·o·det^½; the part under alpha 1/255 is not drawn: 2π·det_dilated^½ / 255.
    const expected = 2 * Math.PI * (0.9 * exact - dilated / 255);
    close(energy / expected, 1, `energy at scale ${scale}`, 0.02);
  }
});

test('the cuts of INRIA are the only visible difference of the rule sets: under 0.0112 outside 3 standard deviations', () => {
  const large = { ...cameraAt([0, 0, 0], [0, 0, 1], { width: 160, height: 160 }), fx: 32, fy: 32 };
  const cloud = cloudOf([ball({ scale: [16, 3, 1], opacity: 0.98 })]);
  const [gsplat, inria] = (['gsplat', 'inria'] as const).map((rules) =>
    renderOracle(cloud, large, { rules, mode: 'classic' }),
  );
  let lost = 0;
  gsplat.transmittance.forEach((t, pixel) => {
    const difference = inria.transmittance[pixel] - t;
    if (difference === 0) return;
    const [dx, dy] = [(pixel % 160) + 0.5 - 80, Math.floor(pixel / 160) + 0.5 - 80];
    assert.ok(Math.max(Math.abs(dx), Math.abs(dy)) >= 3 * Math.sqrt(16 ** 2 + 0.3), 'differs within the circle');
    assert.ok(difference > 0 && difference <= 0.98 * Math.exp(-4.5), `lost ${difference}`);
    lost++;
  });
  assert.ok(lost > 10, 'INRIA does cut something here');
});

test('a color depends on the direction from the eye to the splat', () => {
  // Degree 1 of red along z: looking along +z it adds, looking back along -z it subtracts.
  const cloud = cloudOf([ball({ position: [0, 0, 0], color: [0.5, 0.5, 0.5], sh: [0, 0, 0, 0.4, 0, 0, 0, 0, 0] })], 1);
  const red = (z: number): number => {
    const view = { ...camera, worldToCamera: cameraAt([0, 0, z], [0, 0, 0]).worldToCamera };
    const image = renderOracle(cloud, view, classic);
    return image.color[3 * CENTER] / (1 - image.transmittance[CENTER]);
  };
  close(red(-32), 0.5 + 0.4886025 * 0.4, 'from before');
  close(red(32), 0.5 - 0.4886025 * 0.4, 'from behind');
});

/** Splats about the origin, SH of degree 1, in view of `orbit`. */
const someSplats = (random: Random): SplatDescription[] =>
  repeat(60, () => ({
    position: [random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)],
    scale: [random.logUniform(0.01, 0.4), random.logUniform(0.01, 0.4), random.logUniform(0.01, 0.4)],
    rotation: random.rotation(),
    opacity: random.uniform(0.1, 1),
    color: [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)],
    sh: Array.from({ length: 9 }, () => 0.3 * random.normal()),
  }));
const orbit = cameraAt([0.4, -0.9, -3], [0.1, 0, 0], { width: 48, height: 40 });

test('turning the scene and the camera together leaves the image as it was', () => {
  fc.assert(
    fc.property(fc.integer(), (seed) => {
      // A quarter turn about z: (x, y, z) -> (-y, x, z), exact in float32 except for the quaternion.
      const h = Math.SQRT1_2;
      const splats = someSplats(seededRandom(seed));
      const turned = splats.map((s): SplatDescription => {
        const {
          position: [x, y, z],
          rotation: [w, i, j, k] = [1, 0, 0, 0],
          sh = [],
        } = s;
        // Degree 1 holds the vector (x, y, z) as (-y, z, -x).
        const [sy, sz, sx] = [sh.slice(0, 3), sh.slice(3, 6), sh.slice(6, 9)];
        return {
          ...s,
          position: [-y, x, z],
          rotation: [h * (w - k), h * (i - j), h * (j + i), h * (k + w)],
          sh: [...sx, ...sz, ...sy.map((c) => -c)],
        };
      });
      const back = multiply(orbit.worldToCamera, [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
      const before = renderOracle(cloudOf(splats, 1), orbit, classic);
      const after = renderOracle(cloudOf(turned, 1), { ...orbit, worldToCamera: back }, classic);
      // Rounding the quaternion may move a fragment across the alpha test: 1/255 at a pixel, no more.
      assert.ok(maxAbs(before.color, after.color) < 1.6 / 255);
      assert.ok(psnr(before.color, after.color) > 75, `${psnr(before.color, after.color)} dB`);
    }),
    { numRuns: 30 },
  );
});

test('twice as large and twice as far is the same image, to the last bit', () => {
  fc.assert(
    fc.property(fc.integer(), fc.constantFrom<OracleOptions['rules']>('gsplat', 'inria'), (seed, rules) => {
      const cloud = cloudOf(someSplats(seededRandom(seed)), 1);
      const doubled = {
        ...cloud,
        positions: cloud.positions.map((p) => 2 * p),
        scales: cloud.scales.map((s) => 2 * s),
      };
      const farther = {
        ...orbit,
        near: 2 * orbit.near,
        worldToCamera: orbit.worldToCamera.map((m, i) => (i % 4 === 3 && i < 12 ? 2 * m : m)),
      };
      const options: OracleOptions = { rules, mode: 'antialiased' };
      const near = renderOracle(cloud, orbit, options);
      const medianDepth = near.medianDepth.map((depth) => 2 * depth);
      assert.deepEqual(renderOracle(doubled, farther, options), { ...near, medianDepth });
    }),
    { numRuns: 30 },
  );
});

test('a scene a thousand kilometers from the origin of the world looks the same', () => {
  const scene = room();
  const [here, there] = [scene, movedBy(scene, [1e6, -2e6, 5e5])].map(({ cloud, cameras }) =>
    renderOracle(
      cloud,
      { ...cameras[0], width: 96, height: 64, cx: 48, cy: 32, fx: cameras[0].fx / 5, fy: cameras[0].fy / 5 },
      classic,
    ),
  );
  const decibel = psnr(here.color, there.color);
  assert.ok(decibel > 75, `${decibel} dB`);
});

test('toRgba gives premultiplied color and alpha', () => {
  const image = renderOracle(cloudOf([ball({ color: [1, 0.5, 0] })]), camera, classic);
  const rgba = toRgba(image);
  assert.equal(rgba.length, 4 * 32 * 32);
  [0.5, 0.25, 0, 0.5].forEach((value, k) => close(rgba[4 * CENTER + k], value, `channel ${k}`));
});

test('a splat without a finite image is refused by name', () => {
  const cloud = cloudOf([ball({}), ball({})]);
  cloud.rotations.fill(0, 4, 8);
  assert.throws(
    () => renderOracle(cloud, camera, classic),
    (error: unknown) =>
      error instanceof GaussianSplatError && error.code === 'argument/cloud' && error.where === 'splat 1',
  );
  assert.throws(() => renderOracle({ ...cloud, count: 5 }, camera, classic), { code: 'argument/cloud' });
  assert.throws(() => renderOracle(cloudOf([]), { ...camera, width: 0 }, classic), { code: 'argument/camera' });
});

test('an empty cloud shows the background', () => {
  const image = renderOracle(cloudOf([]), camera, { ...classic, background: [0.1, 0.2, 0.3] });
  assert.deepEqual([...image.color.subarray(0, 3)], [0.1, 0.2, 0.3]);
  assert.equal(image.transmittance[0], 1);
});
