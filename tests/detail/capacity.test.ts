/** How much room the buffers between the stages get as views change. The counts are made up; no GPU. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  CapacityMonitor,
  CountBuffers,
  MIN_CAPACITY,
  CapacityHistory,
  type Capacity,
  type SampledFrame,
} from '@gaussian-splat/renderer/stages';

const MAX = { visible: 4e6, pairs: 50e6 };

/** A monitor and the room that it has asked for last. */
function watch(room: Capacity, min: () => Capacity): { monitor: CapacityMonitor; room: () => Capacity } {
  const device = { createBuffer: () => ({ destroy: () => undefined }) } as unknown as GPUDevice;
  let current = room;
  const monitor = new CapacityMonitor(
    new CountBuffers(device),
    room,
    { min: min, max: MAX },
    new CapacityHistory(),
    (requested) => (current = requested),
  );
  return { monitor, room: () => current };
}

const image = (pixels: number, wholePixels: number): SampledFrame => ({
  pixels,
  wholePixels,
  isWhole: pixels === wholePixels,
});

/** As many looks as make buffers shrink. */
function sample(monitor: CapacityMonitor, used: Capacity): void {
  for (let looks = 0; looks < 4; looks++) monitor.judge(used, false);
}

test('buffers that are nearly empty shrink, and grow before they are full', () => {
  const { monitor, room } = watch({ visible: 4e6, pairs: 6e6 }, () => MIN_CAPACITY);
  sample(monitor, { visible: 1000, pairs: 5000 });
  assert.deepEqual(room(), { visible: 1250, pairs: MIN_CAPACITY.pairs });
  monitor.judge({ visible: 1200, pairs: 5000 }, false);
  assert.deepEqual(room(), { visible: 1500, pairs: MIN_CAPACITY.pairs });
  monitor.judge({ visible: 3.9e6, pairs: 60e6 }, true);
  assert.deepEqual(room(), MAX);
});

test('room that must stay does, and comes back as soon as more of it may', () => {
  let pairs = 1 << 18;
  const { monitor, room } = watch({ visible: 4e6, pairs: 6e6 }, () => ({ visible: 4e6, pairs }));
  sample(monitor, { visible: 1000, pairs: 5000 });
  assert.deepEqual(room(), { visible: 4e6, pairs: 1 << 18 });
  // A pair is known to cost less now: before anything overflows there is room for as many as one submission paints.
  pairs = 6e6;
  monitor.judge({ visible: 30_000, pairs: 80_000 }, false);
  assert.deepEqual(room(), { visible: 4e6, pairs: 6e6 });
  sample(monitor, { visible: 30_000, pairs: 80_000 });
  assert.deepEqual(room(), { visible: 4e6, pairs: 6e6 });
});

test('views that come and go soon keep the room that the largest of them needs', () => {
  const start = { visible: 4e6, pairs: 6e6 };
  const { monitor, room } = watch(start, () => MIN_CAPACITY);
  const rooms = new Set<Capacity>([start]);
  // An orbit of 30 looks: one in three times as many splats as another.
  for (let looks = 0; looks < 3000; looks++) {
    const visible = 2e6 + 1e6 * Math.sin((2 * Math.PI * looks) / 30);
    monitor.judge({ visible, pairs: 1.2 * visible }, false);
    assert.ok(room().visible >= visible, 'there is always room');
    rooms.add(room());
  }
  assert.ok(rooms.size <= 8, `${rooms.size - 1} times other room in 100 turns`);
});

test('frames of fewer pixels do not take the memory that the full frame at rest needs', () => {
  const { monitor, room } = watch({ visible: 4e6, pairs: 6e6 }, () => MIN_CAPACITY);
  const whole = { visible: 3.5e6, pairs: 5e6 };
  const smaller = { visible: 3e6, pairs: 1e6 };
  monitor.isDue(true, image(4_000_000, 4_000_000));
  sample(monitor, whole);
  monitor.isDue(true, image(250_000, 4_000_000));
  for (let k = 0; k < 10; k++) sample(monitor, smaller);
  assert.ok(room().pairs >= whole.pairs, `${room().pairs}`);
  // The element has become smaller: the need of its frame at rest is out of date, but it was five times as much as in motion.
  monitor.isDue(true, image(62_500, 1_000_000));
  for (let k = 0; k < 2; k++) sample(monitor, { ...smaller, pairs: 2e5 });
  assert.equal(room().pairs, 1.25 * 5 * 2e5);
});

/** The need of a view with a multiple of the initial splats; half as many in motion with levels of detail. */
function needAt(view: number, { pixels, isWhole }: SampledFrame): Capacity {
  const visible = view * 1e6 * (isWhole ? 1 : 0.5);
  return { visible, pairs: visible * 2 * (pixels / 4e6) ** 0.3 };
}

for (const pixels of [4_000_000, 1_960_000, 250_000]) {
  test(`a camera that comes nearer in frames of ${pixels} pixels has memory for the full frame at any time`, () => {
    const { monitor, room } = watch({ visible: 2e6, pairs: 2.5e6 }, () => MIN_CAPACITY);
    const see = (view: number, photo: SampledFrame): void => {
      monitor.isDue(true, photo);
      monitor.judge(needAt(view, photo), false);
    };
    const whole = { pixels: 4_000_000, wholePixels: 4_000_000, isWhole: true };
    see(1, whole);
    for (let k = 0; k <= 60; k++) {
      const view = 1.02 ** k;
      see(view, { pixels, wholePixels: 4_000_000, isWhole: false });
      const needed = needAt(view, whole);
      assert.ok(room().pairs >= needed.pairs, `${room().pairs} of ${needed.pairs} pairs at ${view}`);
      assert.ok(room().visible >= needed.visible, `${room().visible} of ${needed.visible} splats at ${view}`);
    }
    assert.ok(room().pairs < 2 * needAt(1.02 ** 60, whole).pairs, 'and not for much more');
  });
}

test('before the first full frame, one of more pixels than those in motion has some memory', () => {
  const { monitor, room } = watch({ visible: 1e6, pairs: 1e6 }, () => MIN_CAPACITY);
  monitor.isDue(true, { pixels: 250_000, wholePixels: 4_000_000, isWhole: false });
  monitor.judge({ visible: 5e5, pairs: 9e5 }, false);
  assert.ok(room().pairs >= 3.6e6, `${room().pairs}`);
});
