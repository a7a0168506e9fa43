import { strict as assert } from 'node:assert';
import { test } from 'node:test';
import fc from 'fast-check';
import { eyeOf, type Camera, type Vector3 } from '@gaussian-splat/core';
import { cloudOf } from '../support/clouds.js';
import { seededRandom } from '../support/random.js';
import { cameraAt } from '../support/scenes.js';
import { footprintOf } from './footprint.js';
import { jacobian, projectEllipse, rotationTimesScale, toCamera, worldPosition, type Ellipse } from './projection.js';
import { RULES } from './rules.js';

const rules = RULES.gsplat;
const camera: Camera = {
  ...cameraAt([0, 0, 0], [0, 0, 1], { width: 400, height: 300, fovXDegrees: 60 }),
  cx: 170,
  cy: 190,
};

/** Splats well within the view of `camera`: 0.001 to 1 long, up to a million times thinner. */
const splats = fc.integer().map((seed) => {
  // Seeds, because fast-check's own doubles are mostly tiny or at the ends of their range.
  const random = seededRandom(seed);
  const [z, long, aspect] = [random.uniform(1, 5), random.logUniform(1e-3, 1), random.logUniform(1, 1e6)];
  return cloudOf([
    {
      position: [random.uniform(-0.3, 0.3) * z, random.uniform(-0.3, 0.3) * z, z],
      scale: [long, long / aspect, long / random.logUniform(1, aspect)],
      rotation: random.rotation(),
      opacity: 1,
      color: [1, 1, 1],
    },
  ]);
});

const near = (found: number, expected: number, tolerance: number, what: string): void =>
  assert.ok(
    Math.abs(found - expected) <= tolerance * Math.max(1, Math.abs(expected)),
    `${what}: ${found}, expected ${expected}`,
  );

test('a ball on the axis becomes a circle of variance (f·s/z)² + 0.3 at the principal point', () => {
  const cloud = cloudOf([{ position: [0, 0, 4], scale: 0.125, opacity: 1, color: [1, 1, 1] }]);
  const ellipse = projectEllipse(cloud, 0, camera, [0, 0, 4], rules);
  const exact = ((camera.fx * 0.125) / 4) ** 2;
  assert.deepEqual([ellipse.x, ellipse.y], [170, 190]);
  near(ellipse.covariance.xx, exact + 0.3, 1e-14, 'xx');
  near(ellipse.covariance.yy, exact + 0.3, 1e-14, 'yy');
  near(ellipse.covariance.xy, 0, 1e-14, 'xy');
  near(ellipse.compensation, exact / (exact + 0.3), 1e-14, 'compensation');
});

test('the Jacobian is the derivative of the pixel position, anywhere in the view', () => {
  const pixel = ([x, y, z]: number[]): number[] => [(camera.fx * x) / z + camera.cx, (camera.fy * y) / z + camera.cy];
  fc.assert(
    fc.property(fc.integer(), (seed) => {
      const random = seededRandom(seed);
      const [column, row, z] = [random.uniform(0, 400), random.uniform(0, 300), 2.5];
      const point: Vector3 = [((column - camera.cx) / camera.fx) * z, ((row - camera.cy) / camera.fy) * z, z];
      const J = jacobian(camera, point, rules);
      for (let axis = 0; axis < 3; axis++) {
        const [ahead, behind] = [1e-5, -1e-5].map((step) => pixel(point.map((p, k) => (k === axis ? p + step : p))));
        for (let k = 0; k < 2; k++) near(J[k][axis], (ahead[k] - behind[k]) / 2e-5, 1e-6, `J[${k}][${axis}]`);
      }
    }),
  );
});

test('beyond 15 % of the image size outside the view the slope in the Jacobian stays, on each side of its own', () => {
  // 0.3·tan(fov/2) is 0.3·(size/2) in pixels: the limits lie at -60..460 of 400 columns and -45..345 of 300 rows.
  const slopeAt = (column: number, row: number): number[] => {
    const z = 3;
    const J = jacobian(camera, [((column - camera.cx) / camera.fx) * z, ((row - camera.cy) / camera.fy) * z, z], rules);
    return [(-J[0][2] * z) / camera.fx, (-J[1][2] * z) / camera.fy];
  };
  const slopeOf = (column: number, row: number): number[] => [
    (column - camera.cx) / camera.fx,
    (row - camera.cy) / camera.fy,
  ];
  for (const [at, expected] of [
    [
      [459, 344],
      [459, 344],
    ],
    [
      [-59, -44],
      [-59, -44],
    ],
    [
      [461, 346],
      [460, 345],
    ],
    [
      [-61, -46],
      [-60, -45],
    ],
    [
      [1e6, -1e6],
      [460, -45],
    ],
  ]) {
    const [found, wanted] = [slopeAt(at[0], at[1]), slopeOf(expected[0], expected[1])];
    found.forEach((slope, k) => near(slope, wanted[k], 1e-12, `slope ${k} at ${at}`));
  }
});

test('the clamp moves the shape, never the center', () => {
  const cloud = cloudOf([{ position: [50, -20, 1], scale: 0.1, opacity: 1, color: [1, 1, 1] }]);
  const ellipse = projectEllipse(cloud, 0, camera, [50, -20, 1], rules);
  near(ellipse.x, 50 * camera.fx + 170, 1e-14, 'x');
  near(ellipse.y, -20 * camera.fy + 190, 1e-14, 'y');
});

test('the quaternion (w, x, y, z) turns local axes as q·v·q⁻¹ does, for any length', () => {
  fc.assert(
    fc.property(fc.integer(), (seed) => {
      const random = seededRandom(seed);
      const [q, length] = [random.rotation(), random.logUniform(0.1, 10)];
      const cloud = cloudOf([
        {
          position: [0, 0, 0],
          scale: [1, 2, 3],
          rotation: [q[0] * length, q[1] * length, q[2] * length, q[3] * length],
          opacity: 1,
          color: [1, 1, 1],
        },
      ]);
      const columns = [0, 1, 2].map((axis) =>
        turn(
          q,
          [0, 1, 2].map((k) => (k === axis ? axis + 1 : 0)),
        ),
      );
      const found = rotationTimesScale(cloud, 0);
      for (let row = 0; row < 3; row++)
        for (let k = 0; k < 3; k++) near(found[row][k], columns[k][row], 1e-6, `${row},${k}`);
    }),
  );
});

/** q·v·q⁻¹ by Rodrigues: v + 2u×(u×v + w·v). */
function turn([w, ...u]: readonly number[], v: readonly number[]): number[] {
  const cross = (a: readonly number[], b: readonly number[]): number[] => [
    a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2],
    a[0] * b[1] - a[1] * b[0],
  ];
  const inner = cross(u, v).map((c, k) => c + w * v[k]);
  return cross(u, inner).map((c, k) => v[k] + 2 * c);
}

test('points drawn from a small Gaussian and seen through a pinhole have the covariance of the ellipse', () => {
  const random = seededRandom(11);
  const turned = cameraAt([3, -2, -5], [0.3, 0.2, 0.5], { width: 400, height: 300, fovXDegrees: 40 });
  const [scale, q, center] = [[0.03, 0.01, 0.002] as const, random.rotation(), [0.4, -0.1, 0.2] as const];
  const cloud = cloudOf([{ position: center, scale, rotation: q, opacity: 1, color: [1, 1, 1] }]);
  const sum = { x: 0, y: 0, xx: 0, xy: 0, yy: 0 };
  const n = 200_000;
  for (let i = 0; i < n; i++) {
    const offset = turn(
      q,
      scale.map((s) => s * random.normal()),
    );
    const [x, y, z] = toCamera(turned, [center[0] + offset[0], center[1] + offset[1], center[2] + offset[2]]);
    const [u, v] = [(turned.fx * x) / z, (turned.fy * y) / z];
    sum.x += u / n;
    sum.y += v / n;
    sum.xx += (u * u) / n;
    sum.xy += (u * v) / n;
    sum.yy += (v * v) / n;
  }
  const ellipse = projectEllipse(cloud, 0, turned, toCamera(turned, worldPosition(cloud, 0)), rules);
  const { xx, xy, yy } = ellipse.covariance;
  assert.ok(
    xx > 1 && yy > 1 && Math.abs(xy) > 1,
    `seed chosen for a slanted ellipse of some pixels: ${xx} ${xy} ${yy}`,
  );
  near(sum.xx - sum.x ** 2 + 0.3, xx, 0.02, 'xx');
  near(sum.yy - sum.y ** 2 + 0.3, yy, 0.02, 'yy');
  assert.ok(Math.abs(sum.xy - sum.x * sum.y - xy) < 0.02 * Math.sqrt(xx * yy), 'xy');
});

test('the conic is the inverse of the covariance, for needles too', () => {
  fc.assert(
    fc.property(splats, (cloud) => {
      const { covariance: s, conic: c } = projectEllipse(
        cloud,
        0,
        camera,
        toCamera(camera, worldPosition(cloud, 0)),
        rules,
      );
      const size = Math.max(s.xx, s.yy) * Math.max(c.xx, c.yy);
      assert.ok(Math.abs(s.xx * c.xx + s.xy * c.xy - 1) < 1e-12 * size);
      assert.ok(Math.abs(s.xx * c.xy + s.xy * c.yy) < 1e-12 * size);
      assert.ok(Math.abs(s.xy * c.xy + s.yy * c.yy - 1) < 1e-12 * size);
      assert.ok(c.xx > 0 && c.yy > 0 && c.xx * c.yy > c.xy * c.xy, 'positive definite');
    }),
    { numRuns: 500 },
  );
});

test('the compensation keeps the integral that the splat had before dilation, down to its floor', () => {
  const noFloor = { ...rules, compensationFloor: 0 };
  fc.assert(
    fc.property(splats, (cloud) => {
      const center = toCamera(camera, worldPosition(cloud, 0));
      const { covariance: s, compensation } = projectEllipse(cloud, 0, camera, center, noFloor);
      const determinant = (d: number): number => (s.xx - d) * (s.yy - d) - s.xy * s.xy;
      const tolerance = 1e-12 * Math.max(1, s.xx * s.yy);
      near(compensation ** 2 * determinant(0), determinant(rules.dilation), tolerance, 'determinant');
      const floored = projectEllipse(cloud, 0, camera, center, rules).compensation;
      assert.equal(floored, Math.max(0.005, compensation));
    }),
  );
});

test('the eye that colors are seen from is the center of the view', () => {
  const eye: Vector3 = [3, -2, -5];
  toCamera(cameraAt(eye, [0, 0, 1]), eyeOf(cameraAt(eye, [0, 0, 1]).worldToCamera)).forEach((c) =>
    near(c, 0, 1e-12, 'eye'),
  );
});

test('a needle that points at the eye keeps 0.005 of its opacity, the floor of both rule sets', () => {
  const cloud = cloudOf([{ position: [0, 0, 4], scale: [0, 0, 1], opacity: 1, color: [1, 1, 1] }]);
  for (const set of [RULES.gsplat, RULES.inria]) {
    near(projectEllipse(cloud, 0, camera, [0, 0, 4], set).compensation, 0.005, 1e-12, 'compensation');
  }
  assert.equal(projectEllipse(cloud, 0, camera, [0, 0, 4], { ...rules, compensationFloor: 0 }).compensation, 0);
});

/** An ellipse as `projectEllipse` makes it, for whole-number pixel centers as INRIA counts them. */
const ellipseAt = (x: number, y: number, covariance: Ellipse['covariance']): Ellipse => ({
  x: x + 0.5,
  y: y + 0.5,
  covariance,
  conic: { xx: NaN, xy: NaN, yy: NaN },
  compensation: 1,
});

test("INRIA's footprint is the 16x16 tiles that 3 standard deviations of the longest axis reach", () => {
  const footprint = (ellipse: Ellipse): number[] => {
    const { left, right, top, bottom } = footprintOf(ellipse, 1, camera, RULES.inria);
    return [left, right, top, bottom];
  };
  const long = { xx: 25, xy: 0, yy: 1 }; // radius 15
  assert.deepEqual(footprint(ellipseAt(46, 49, long)), [16, 64, 32, 64]);
  assert.deepEqual(footprint(ellipseAt(47, 50, long)), [32, 64, 32, 80]);
  // A slanted one has the same longest axis whichever way it points: eigenvalues 25 and 1.
  assert.deepEqual(footprint(ellipseAt(46, 49, { xx: 13, xy: 12, yy: 13 })), [16, 64, 32, 64]);
  // A circle counts as at least sqrt(0.1) larger in variance: radius 3 instead of 3·sqrt(0.3), which is 1.6.
  assert.deepEqual(footprint(ellipseAt(18, 19, { xx: 0.3, xy: 0, yy: 0.3 })), [0, 32, 16, 32]);
  // Off the image on the left and above; cut by the right and lower edges, 400 and 300, which tiles overlap.
  assert.deepEqual(footprint(ellipseAt(-40, -40, long)), [0, 0, 0, 0]);
  assert.deepEqual(footprint(ellipseAt(399, 299, long)), [384, 400, 272, 300]);
});
