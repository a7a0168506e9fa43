/** What `stats` says of a scene, in sentences for people. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { LoadedGaussians } from '../../packages/element/src/gpu/loaded-gaussians.js';
import { statsOf, type StatsContext } from '../../packages/element/src/stats.js';

const scene = {
  gaussians: { count: 60, byteLength: 0 },
  detail: {},
  bounds: {},
  warnings: [],
} as unknown as LoadedGaussians;

test('splats for which the device has no room are told of, after they were counted', () => {
  const pace = { moving: 'whole' } as unknown as StatsContext['dynamicQuality'];
  const context = {
    quality: 'default',
    dynamicQuality: pace,
    isPreview: false,
    frameBytes: 0,
    pixels: 0,
    parts: [],
  } as const;
  const whyOf = (left: number): string =>
    statsOf([scene], { ...context, counts: { drawn: 60, left, contributed: 9 } }).why.join();
  assert.equal(whyOf(0), '');
  assert.match(whyOf(1200), /^1200 splats are not drawn: the GPU allows no buffer/);
});
