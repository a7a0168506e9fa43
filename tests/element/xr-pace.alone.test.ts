/** Time limits of a session's frame by the headset's rate, and the resulting size of the image. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { ViewOrder } from '../../packages/element/dist/features/xr/view-order.js';
import { XrLoop } from '../../packages/element/dist/features/xr/xr-session.js';

function loopAt(frameRate: number | undefined): XrLoop {
  const session = { frameRate, updateRenderState: () => undefined, requestAnimationFrame: () => 0 };
  const guide = { background: [0, 0, 0, 1] as const, place: () => null };
  return new XrLoop(session as never, {} as never, {} as never, guide);
}

for (const [rate, milliseconds] of [
  [72, 11.11],
  [90, 8.89],
  [120, 6.67],
  [undefined, 11.11],
] as const) {
  test(`at ${rate ?? 'an unknown number of'} frames a second a frame may take ${milliseconds} ms`, () => {
    const loop = loopAt(rate);
    assert.ok(Math.abs(loop.targetMs - milliseconds) < 0.01, `${loop.targetMs} ms`);
    loop.adapt(loop.targetMs - 0.1);
    assert.equal(loop.scale, 1);
    loop.adapt(loop.targetMs + 0.1);
    assert.ok(loop.scale < 1, 'fewer pixels');
    for (let k = 0; k < 20; k++) loop.adapt(3 * loop.targetMs);
    assert.equal(loop.scale, 0.5);
    // Between half of it and all of it nothing changes, so that the size does not swing.
    loop.adapt(0.75 * loop.targetMs);
    assert.equal(loop.scale, 0.5);
    for (let k = 0; k < 20; k++) loop.adapt(0.3 * loop.targetMs);
    assert.equal(loop.scale, 1);
  });
}

test('a scene that is too slow at the lowest resolution lowers the rate of the headset, not below 72 Hz', () => {
  const rates: number[] = [];
  const session = {
    ...{ frameRate: 120, supportedFrameRates: new Float32Array([60, 72, 90, 120]) },
    ...{ updateRenderState: () => undefined, requestAnimationFrame: () => 0 },
    updateTargetFrameRate(rate: number): Promise<void> {
      rates.push((this.frameRate = rate));
      return Promise.resolve();
    },
  };
  const guide = { background: [0, 0, 0, 1] as const, place: () => null };
  const loop = new XrLoop(session as never, {} as never, {} as never, guide);
  while (loop.scale > 0.5) loop.adapt(30);
  assert.deepEqual(rates, []);
  for (let k = 0; k < 4; k++) loop.adapt(30);
  assert.deepEqual(rates, [90, 72]);
});

test('one sort that was interrupted does not end orders by depth, and slow sorts do', (t) => {
  // A sort takes the time from one reading of the clock to the next.
  let [now, sortMs] = [0, 3];
  t.mock.method(performance, 'now', () => (now += sortMs));
  let orders = 0;
  const scene = {
    positions: Float32Array.from([0, 0, 1, 0, 0, 2]),
    origin: [0, 0, 0],
    renderer: { setOrder: () => orders++ },
  };
  const order = new ViewOrder(scene as never, () => assert.fail('a worker'));
  let depth = 0;
  const update = (milliseconds: number): boolean => {
    sortMs = milliseconds;
    const before = orders;
    const worldToCamera = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, (depth += 0.1), 0, 0, 0, 1];
    const camera = { ...{ worldToCamera, width: 8, height: 8, fx: 8, fy: 8, cx: 4, cy: 4, near: 0.1, far: 9 } };
    order.update([camera as never], false);
    return orders > before;
  };
  for (const milliseconds of [3, 3, 80, 3, 3]) assert.equal(update(milliseconds), true, `${milliseconds} ms`);
  for (let i = 0; i < 3; i++) update(20);
  assert.ok(order.milliseconds > 8, `${order.milliseconds} ms`);
});
