/** Views that measure a scene without cameras. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { eyeOf, type Vector3 } from '@gaussian-splat/core';
import { dealtViewsOfVisitors, optimizeWithin, type OptimizeOptions } from '@gaussian-splat/optimize';
import { uprightRotation } from '@gaussian-splat/formats';
import { dealViews } from '../../packages/cli/src/lib/given-views.mjs';
import { smallCloud } from '../formats/support/small-cloud.js';

test('visitors stand upright in a scene that names its direction up', () => {
  const bounds = { min: [1, 1, 1], max: [3, 5, 7], center: [2, 3, 4], radius: 2 } as const;
  for (const up of [undefined, [0, -1, 0], [0, 0, 1], [0.6, 0.8, 0]] as const) {
    const { scored, searched, heldOut } = dealtViewsOfVisitors(bounds, 40, up);
    const along = ([x, y, z]: Vector3, [a, b, c]: Vector3 = up ?? [0, -1, 0]): number => a * x + b * y + c * z;
    const heights = [...scored, ...searched, ...heldOut].map(({ worldToCamera: m }) => {
      assert.ok(along([m[4], m[5], m[6]]) < 0, 'the image is upright');
      const eye = eyeOf(m).map((value, axis) => value - bounds.center[axis]) as unknown as Vector3;
      return along(eye) / Math.hypot(...eye);
    });
    const max = Math.max(...heights.map(Math.abs));
    assert.ok(max > 0.8 && max < Math.sin(1.171), `${up?.join()}: sine of the elevation ${max}`);
  }
});

test('given views stay where they are in a scene that is rotated upright', () => {
  const K = [[100, 0, 32], [0, 100, 24], [0, 0, 1]]; // prettier-ignore
  const views = Array.from({ length: 8 }, (_, k) => ({
    ...{ width: 64, height: 48, K },
    worldToCamera: [[1, 0, 0, k], [0, 1, 0, 2], [0, 0, 1, 5], [0, 0, 0, 1]], // prettier-ignore
  }));
  const rotation = uprightRotation({ hints: { up: [0, 0, 1] } })!;
  const [given] = dealViews(views, 'views.json').dealt.scored;
  const [rotated] = dealViews(views, 'views.json', rotation).dealt.scored;
  const point = [0.3, -0.7, 1.1];
  const seen = (m: ArrayLike<number>, p: readonly number[]): number[] =>
    [0, 4, 8].map((row) => m[row] * p[0] + m[row + 1] * p[1] + m[row + 2] * p[2] + m[row + 3]);
  const turned = [0, 3, 6].map((row) => point.reduce((sum, value, k) => sum + rotation[row + k] * value, 0));
  seen(rotated.worldToCamera, turned).forEach((value, axis) =>
    assert.ok(Math.abs(value - seen(given.worldToCamera, point)[axis]) < 1e-9, `axis ${axis}`),
  );
  assert.throws(() => dealViews(views.slice(0, 3), 'views.json'), /expected 8 views or more/);
});

test('a size is not blamed for views that show nothing', async () => {
  const cloud = smallCloud(20, 0);
  const figures = { errors: [], degrees: [20, 0, 0, 0] };
  const evaluator = {
    rank: () => Promise.resolve({ contribution: new Float32Array(20).fill(1), removalError: new Float32Array(20) }),
    cut: () => Promise.resolve(figures),
    compare: () => Promise.resolve([]),
  } as unknown as OptimizeOptions['evaluator'];
  await assert.rejects(optimizeWithin(cloud, 1e9, { name: 'a.ply', evaluator }), /views that show some of the scene/);
});
