/**
 * S15. Subgroups of 4 to 128 threads, which may even differ within a pipeline.
 *
 * Who fails: sorts that count with ballots: b0nes164/GPUSorting #4 (wrong on Adreno), vulkan_radix_sort #7, VkRadixSort #7; PlayCanvas had a buffer too small for
 * subgroups of 16, and wrong bits of inactive lanes on Mali and IMG.
 *
 * Recipe: asked for subgroups of 4 to 128 threads. Run without any: no shader votes.
 *
 * Passes: no shader uses subgroups, and sorted permutations are those of a stable sort on the CPU for any keys.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import type { Threads } from '@gaussian-splat/renderer/tools';
import { constants, SortStage } from '@gaussian-splat/renderer/stages';
import { runCase } from '../support/gpu.js';
import { nodeDevice } from '../support/node-device.js';
import { holds, sized } from './support/row.js';
import { planFor, stableOrder } from './support/sorting.js';
import { shaderTexts } from './support/sources.js';

test('nothing uses subgroups', () => {
  const users = [...shaderTexts()].filter(([, text]) =>
    /\bsubgroup[A-Z]|\bquad(?:Swap|Broadcast)|enable\s+subgroups/.test(text),
  );
  assert.deepEqual(
    users.map(([name]) => name),
    [],
  );
});

const { SORT_BLOCK, DIGITS } = constants;

/** Runs, single digits, few values, all bits. */
const keys = fc
  .record({
    count: fc.oneof(
      fc.integer({ min: 1, max: 600 }),
      fc.constantFrom(SORT_BLOCK - 1, SORT_BLOCK, SORT_BLOCK + 1, 2 * SORT_BLOCK + 77),
    ),
    values: fc.array(fc.nat(0xffffffff), { minLength: 1, maxLength: 50 }),
    mask: fc.constantFrom(0xffffffff, 0xff, 0xff00, 0xff0000, 0xff000000, 0x01010101, 0xffffff),
    step: fc.integer({ min: 1, max: 49 }),
  })
  .map(({ count, values, mask, step }) =>
    Uint32Array.from(
      { length: count },
      (_, i) => (Math.imul(values[(i * step) % values.length], 1 + (i >> 5)) & mask) >>> 0,
    ),
  );

/** Keys that a sort has misplaced, over random lists of them. */
async function misplaced(device: GPUDevice, threads: Threads, numRuns: number): Promise<number> {
  const stage = new SortStage(device, threads);
  let wrong = 0;
  await fc.assert(
    fc.asyncProperty(keys, async (keys) => {
      let order: Uint32Array | undefined;
      const count = keys.length;
      await runCase(device, {
        name: 'sort',
        async run(bench) {
          const plan = bench.buffer(planFor(count));
          const values = [bench.buffer(4 * count), bench.buffer(4 * count)] as const;
          const bindings = stage.bind({
            plan,
            keys: [bench.buffer(keys), bench.buffer(4 * count)],
            values,
            digitCounts: bench.buffer(4 * DIGITS * Math.ceil(count / SORT_BLOCK)),
            digitTotals: bench.buffer(4 * DIGITS),
          });
          bench.compute((pass) => stage.record(pass, bindings, count));
          order = await bench.read(values[0], 4 * count);
        },
      });
      const errors = stableOrder(keys).filter((index, rank) => order![rank] !== index).length;
      wrong += errors;
      return errors === 0;
    }),
    { numRuns, seed: 15 },
  );
  return wrong;
}

for (const threads of ['parallel', 'serial'] as const) {
  test(`any keys, ${threads}`, async () => {
    const wrong = await misplaced(await nodeDevice(), threads, sized(8, 400));
    holds('S15', `misplaced keys, ${threads}`, wrong, { atMost: 0, unit: 'keys' });
  });
}
