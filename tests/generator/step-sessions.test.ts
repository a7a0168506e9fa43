/** How many instances a recorded run computes, by the number of those that ask. */
import assert from 'node:assert/strict';
import test from 'node:test';
import { stepOf } from '../../packages/generator/src/batch/step-sessions.js';

test('sessions are few, and compute at most a third in vain from six instances on', () => {
  const steps = Array.from({ length: 32 }, (_, i) => stepOf(i + 1));
  assert.deepEqual([...new Set(steps)], [1, 2, 4, 6, 8, 12, 16, 24, 32]);
  steps.forEach((step, i) => assert.ok(step >= i + 1 && (i < 5 || (step - i - 1) / step <= 0.34), `${i + 1}: ${step}`));
});
