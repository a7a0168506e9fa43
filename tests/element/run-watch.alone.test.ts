/** Samples of a generator's Gaussians: when they are read, and which faults they report. */
import assert from 'node:assert/strict';
import { mock, test } from 'node:test';
import type { Bounds } from '@gaussian-splat/core';
import { RunWatch, type Watched } from '../support/element/parts.js';

type Sample = Awaited<ReturnType<Watched['readSample']>>;
const DRAWN: Sample = { bounds: {} as Bounds, drawn: 64, unusable: 0 };

/** A watch of samples that a test sets, with a clock that it moves. */
function watchOf(): {
  watch: RunWatch;
  errors: string[];
  show: (sample: Sample) => Promise<void>;
  reads: () => number;
  block: () => () => void;
} {
  let sample = DRAWN;
  let reads = 0;
  let idle: Promise<void> = Promise.resolve();
  const errors: string[] = [];
  const gaussians = { count: 64, readSample: () => Promise.resolve((reads++, sample)) };
  const watch = new RunWatch(gaussians, {
    where: 'model.onnx',
    idle: () => idle,
    onError: (error) => errors.push(String((error as Error).message)),
    onBounds: () => undefined,
  });
  return {
    watch,
    errors,
    show: async (next) => {
      sample = next;
      watch.frameMade();
      mock.timers.tick(701);
      await settled();
    },
    reads: () => reads,
    block: () => {
      let end = (): void => undefined;
      idle = new Promise((resolve) => (end = resolve));
      return end;
    },
  };
}

const settled = async (): Promise<void> => {
  for (let i = 0; i < 10; i++) await Promise.resolve();
};

test.beforeEach(() => mock.timers.enable({ apis: ['setTimeout'] }));
test.afterEach(() => mock.timers.reset());

test('a count outside of the rows is one error that names it, until a run has a valid one', async () => {
  const { errors, show } = watchOf();
  const counted = (count: number): Sample => ({ ...DRAWN, counted: { count, rows: 64 } });
  await show(counted(64));
  assert.deepEqual(errors, []);
  await show(counted(1000));
  await show(counted(1000));
  assert.equal(errors.length, 1);
  assert.match(errors[0], /a count of 0 to 64.*1000; all rows are drawn/);
  await show(counted(0));
  await show({ ...counted(-3), drawn: 0 });
  assert.match(errors[1], /found -3; no row is drawn/);
  assert.equal(errors.length, 2);
});

test('a generator whose runs take longer than the pause is not sampled after each of them', async () => {
  const { watch, reads, block } = watchOf();
  for (let run = 0; run < 5; run++) {
    const end = block();
    watch.frameMade();
    mock.timers.tick(701);
    await settled();
    // The next run ends.
    watch.frameMade();
    end();
    await settled();
  }
  assert.equal(reads(), 0);
  mock.timers.tick(701);
  await settled();
  assert.equal(reads(), 1);
});
