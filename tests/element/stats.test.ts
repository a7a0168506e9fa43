/** What `stats` says of a scene, in sentences for people. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { GpuScene } from '../../packages/element/src/gpu/gpu-scene.js';
import { statsOf, type StatsContext } from '../../packages/element/src/stats.js';

const whole = { spared: 0, decibels: null, byView: false };
const scene = { gaussians: { count: 60, byteLength: 0 }, detail: {}, frameBytes: 0 } as unknown as GpuScene;
const why = (economy: StatsContext['economy']): string => {
  const pace = { moving: 'whole' } as unknown as StatsContext['pace'];
  return statsOf(scene, { quality: 'default', pace, counts: undefined, economy, isPreview: false }).why.join();
};

test('splats for which the device has no room are told of, after they were counted', () => {
  const pace = { moving: 'whole' } as unknown as StatsContext['pace'];
  const context = { quality: 'default', pace, economy: whole, isPreview: false } as const;
  const whyOf = (left: number): string =>
    statsOf(scene, { ...context, counts: { drawn: 60, left, contributed: 9 } }).why.join();
  assert.equal(whyOf(0), '');
  assert.match(whyOf(1200), /^1200 splats are not drawn: the GPU allows no buffer/);
});

test('what economy costs is said in dB, and where it costs nothing it is said so', () => {
  assert.equal(why({ spared: 0, decibels: null, byView: false }), '');
  assert.match(why({ spared: 40, decibels: null, byView: false }), /^40 splats .* are left out\.$/);
  assert.match(why({ spared: 40, decibels: 57.12, byView: false }), /are left out: 57\.1 dB to the whole scene\.$/);
  assert.match(why({ spared: 40, decibels: Infinity, byView: false }), /are left out, without a trace\.$/);
  assert.match(why({ spared: 0, decibels: 61, byView: true }), /from their side: 61\.0 dB to the whole scene\.$/);
  assert.match(why({ spared: 0, decibels: Infinity, byView: true }), /from their side, without a trace\.$/);
});
