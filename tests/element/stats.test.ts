/** What `stats` says of a scene, in sentences for people. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { faultsOf } from '@gaussian-splat/renderer/tools';
import type { LoadedGaussians } from '../../packages/element/src/gpu/loaded-gaussians.js';
import { statsOf, type StatsContext } from '../../packages/element/src/stats.js';

const scene = {
  gaussians: { count: 60, byteLength: 0 },
  detail: {},
  bounds: {},
  warnings: [],
  place: { context: {} },
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

test('what the self-test found wrong is told of', () => {
  const { context } = scene.place;
  faultsOf(context).push('The self-test finds errors of this GPU: parallel prefix sums.');
  const pace = { moving: 'whole' } as unknown as StatsContext['dynamicQuality'];
  const known = {
    quality: 'default',
    dynamicQuality: pace,
    isPreview: false,
    frameBytes: 0,
    pixels: 0,
    parts: [],
  } as const;
  assert.deepEqual(statsOf([scene], { ...known, counts: undefined }).why, faultsOf(context));
  assert.deepEqual(faultsOf({}), []);
});
