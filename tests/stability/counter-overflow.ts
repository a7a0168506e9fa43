/**
 * S13. Counts beyond 32 bits.
 *
 * Who fails: INRIA's rasterizer keeps the number of pairs in an int (read in its source); 525,000 splats over an image of 8192 x 8192 make more than 4.29 billion
 * pairs of splat and bin. A sum that wraps around looks like room for everything.
 *
 * Passes: sums stop at the largest number, whatever the counts: nothing is written where it does not belong, and the overflow is reported.
 */
import { test } from 'node:test';
import fc from 'fast-check';
import { ScanStage } from '@gaussian-splat/renderer/stages';
import { runCase } from '../support/gpu.js';
import { nodeDevice } from '../support/node-device.js';
import { holds, sized } from './support/row.js';

const MOST = 0xffffffff;

/** The twin: exclusive sums that stop at the largest number, and behind them the total. */
function saturatingSums(values: readonly number[]): number[] {
  const sums = [0];
  for (const value of values) sums.push(Math.min(MOST, sums[sums.length - 1] + value));
  return sums;
}

test('prefix sums of any counts stop at the largest number', async () => {
  const device = await nodeDevice();
  let wrong = 0;
  const count = fc.oneof(fc.nat(70_000), fc.constantFrom(0, 1, MOST, 0x80000000, 0x7fffffff, 5_000_000), fc.nat(MOST));
  const counts = fc
    .tuple(fc.array(count, { minLength: 1, maxLength: 40 }), fc.constantFrom(1, 3, 250))
    .map(([values, times]) => Array.from({ length: values.length * times }, (_, i) => values[i % values.length]));
  await fc.assert(
    fc.asyncProperty(counts, async (values) => {
      let found: Uint32Array | undefined;
      await runCase(device, {
        name: 'saturating scan',
        async run(bench) {
          const stage = new ScanStage(device);
          const buffer = bench.buffer(Uint32Array.from([...values, 0]));
          const bindings = stage.bind({ values: buffer, scan: bench.uniform(values.length) });
          bench.compute((pass) => stage.record(pass, bindings));
          found = await bench.read(buffer, 4 * (values.length + 1));
        },
      });
      const errors = saturatingSums(values).filter((sum, i) => sum !== found![i]).length;
      wrong += errors;
      return errors === 0;
    }),
    { numRuns: sized(60, 600), seed: 13 },
  );
  holds('S13', 'wrong prefix sums of counts beyond 32 bits', wrong, { atMost: 0, unit: 'sums' });
});
