import assert from 'node:assert/strict';
import { test } from 'node:test';
import fc from 'fast-check';
import { Damper } from '../support/element/camera.js';

const value = fc.double({ min: -1e6, max: 1e6, noNaN: true });
const decay = fc.double({ min: 1, max: 1e4, noNaN: true });

/** Independent of the closed form: the same spring by many small steps of Heun's method, from rest. */
function integrate(distance: number, timeMs: number, decayMs: number): number {
  const frequency = 1 / decayMs;
  const steps = 20_000;
  const dt = timeMs / steps;
  let [x, v] = [distance, 0];
  for (let i = 0; i < steps; i++) {
    const acceleration = -frequency * frequency * x - 2 * frequency * v;
    const [nextX, nextV] = [x + v * dt, v + acceleration * dt];
    const nextAcceleration = -frequency * frequency * nextX - 2 * frequency * nextV;
    x += ((v + nextV) / 2) * dt;
    v += ((acceleration + nextAcceleration) / 2) * dt;
  }
  return x;
}

test('follows the equation of the critically damped spring', () => {
  for (const timeMs of [10, 50, 130, 400]) {
    const damper = new Damper();
    assert.ok(Math.abs(damper.step(1, 0, timeMs, 50, 1) - integrate(1, timeMs, 50)) < 1e-6);
  }
});

test('the path does not depend on the frame rate', () => {
  fc.assert(
    fc.property(value, value, decay, fc.integer({ min: 2, max: 50 }), (from, goal, decayMs, parts) => {
      const [once, often] = [new Damper(), new Damper()];
      const scale = Math.abs(from - goal) + 1;
      const direct = once.step(from, goal, decayMs, decayMs, 1e-9 * scale);
      let x = from;
      for (let i = 0; i < parts; i++) x = often.step(x, goal, decayMs / parts, decayMs, 1e-9 * scale);
      assert.ok(Math.abs(x - direct) <= 1e-9 * (Math.abs(from) + Math.abs(goal) + 1));
    }),
  );
});

test('from rest it never passes its goal, comes closer at every step, and arrives exactly', () => {
  fc.assert(
    fc.property(value, value, decay, fc.double({ min: 0.01, max: 3, noNaN: true }), (from, goal, decayMs, ratio) => {
      const damper = new Damper();
      const scale = Math.max(Math.abs(from - goal), 1e-9);
      // The goal is large and the way short, so the goal's rounding error exceeds the last steps.
      const rounding = 1e-10 * Math.max(Math.abs(from), Math.abs(goal));
      let x = from;
      for (let i = 0; i < 5_000 && x !== goal; i++) {
        const next = damper.step(x, goal, ratio * decayMs, decayMs, scale);
        assert.ok(Math.abs(next - goal) <= Math.abs(x - goal) + rounding);
        assert.ok(Math.sign(from - goal) * (next - goal) >= -rounding);
        x = next;
      }
      assert.ok(x === goal, `still at ${x}`);
    }),
    { endOnFailure: true, numRuns: 300 },
  );
});

test('without a time constant it jumps', () => {
  assert.equal(new Damper().step(3, 7, 16, 0, 1), 7);
});

test('a stopped damper starts from rest', () => {
  const [moving, stopped] = [new Damper(), new Damper()];
  moving.step(1, 0, 20, 50, 1);
  stopped.step(1, 0, 20, 50, 1);
  stopped.stop();
  assert.ok(moving.step(0.9, 0, 10, 50, 1) < stopped.step(0.9, 0, 10, 50, 1));
});
