/** How many pixels frames get that splats cover too often. The sums are made up; no GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { OverdrawLimit } from '@gaussian-splat/renderer/webgl';

test('a view that stays is drawn again at most twice, however its sum trembles', () => {
  for (const covered of [900, 999, 1_001, 1_050, 1_249, 1_251, 2_000, 20_000, 1e7]) {
    const limit = new OverdrawLimit();
    let frames = 0;
    for (let look = 0; look < 50; look++) if (limit.note(covered * (1 + 0.02 * Math.sin(look)), 0)) frames++;
    assert.ok(frames <= 2, `${frames} frames with ${covered}`);
    assert.ok(covered * limit.share <= 1_030, `${covered} times at ${limit.share}`);
  }
});

test('pixels come back with a view that covers less', () => {
  const limit = new OverdrawLimit();
  assert.equal(limit.mayExceed(10), false);
  limit.note(20_000, 0);
  assert.ok(Math.abs(limit.share - 0.04) < 1e-9);
  assert.equal(limit.mayExceed(10), true, 'a scene of few splats may follow');
  assert.equal(limit.note(10_000, 0), true);
  assert.equal(limit.note(0, 0), true);
  assert.equal(limit.share, 1);
  assert.equal(limit.mayExceed(10), false);
  assert.equal(limit.note(0, 0), false);
});
