/** The sentences of `stats` about a scene. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { faultsOf } from '@gaussian-splat/renderer/tools';
import { type LoadedGaussians, statsOf, type StatsContext } from '../support/element/parts.js';

const scene = {
  gaussians: { count: 60, byteLength: 0 },
  detail: {},
  bounds: {},
  warnings: [],
  place: { context: {} },
} as unknown as LoadedGaussians;

test('splats beyond the capacity of the device are reported, after they were counted', () => {
  const quality = { moving: 'whole' } as unknown as StatsContext['dynamicQuality'];
  const context = {
    quality: 'default',
    dynamicQuality: quality,
    isPreview: false,
    frameBytes: 0,
    pixels: 0,
    parts: [],
  } as const;
  const whyOf = (left: number): string =>
    statsOf([scene], { ...context, counts: { drawn: 60, left, contributing: 9 } }).reasons.join();
  assert.equal(whyOf(0), '');
  assert.match(whyOf(1200), /^1200 splats are not drawn, because the GPU does not allow larger buffers/);
});

test('failures of the self-test are reported', () => {
  const { context } = scene.place;
  faultsOf(context).push('The self-test finds errors of this GPU: parallel prefix sums.');
  const quality = { moving: 'whole' } as unknown as StatsContext['dynamicQuality'];
  const known = {
    quality: 'default',
    dynamicQuality: quality,
    isPreview: false,
    frameBytes: 0,
    pixels: 0,
    parts: [],
  } as const;
  assert.deepEqual(statsOf([scene], { ...known, counts: undefined }).reasons, faultsOf(context));
  assert.deepEqual(faultsOf({}), []);
});

test('a streamed scene says what it rests at', () => {
  const progress = { resident: 3, total: 9, limit: 'memory', reasons: ['3 of 9 pages are on the GPU'] } as const;
  const streamed = { ...scene, gaussians: { ...scene.gaussians, progress } } as unknown as LoadedGaussians;
  const found = statsOf([scene, streamed], {
    quality: 'default',
    dynamicQuality: { moving: 'whole' } as unknown as StatsContext['dynamicQuality'],
    counts: undefined,
    isPreview: false,
    frameBytes: 0,
    pixels: 0,
    parts: [],
  });
  assert.deepEqual(found.streamed, [progress]);
  assert.ok(found.reasons.includes(progress.reasons[0]));
});

test('the number of splats of a scene with levels is that of its finest level, or of its pages if those are fewer', () => {
  const splatsOf = (gaussians: object): number[] => {
    const context = { dynamicQuality: { moving: 'whole' }, parts: [] } as unknown as StatsContext;
    const { splats, resident } = statsOf([{ ...scene, gaussians } as unknown as LoadedGaussians], context);
    return [splats, resident];
  };
  assert.deepEqual(splatsOf({ count: 927_744, leafCount: 500_000 }), [500_000, 927_744]);
  assert.deepEqual(splatsOf({ count: 4_096, leafCount: 500_000 }), [4_096, 4_096]);
  assert.deepEqual(splatsOf({ count: 9, frameCount: 4 }), [4, 9]);
});

test('unusable rows of a generator are part of its total, those of a file are not', () => {
  const gaussians = { count: 64, droppedCount: 60, byteLength: 0 };
  const totalOf = (live: object | undefined): number => {
    const context = { dynamicQuality: { moving: 'whole' }, parts: [] } as unknown as StatsContext;
    return statsOf([{ ...scene, gaussians, live } as unknown as LoadedGaussians], context).total;
  };
  assert.deepEqual([totalOf({ inputs: [] }), totalOf(undefined), totalOf({})], [64, 124, 124]);
});
