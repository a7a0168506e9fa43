/**
 * S15. Subgroups of 4 to 128 threads, which may even differ within a pipeline.
 *
 * Who fails: sorts that count with ballots: b0nes164/GPUSorting #4 (wrong on Adreno), vulkan_radix_sort #7, VkRadixSort #7; PlayCanvas had a buffer too small for
 * subgroups of 16, and wrong bits of inactive lanes on Mali and IMG.
 *
 * Recipe: asked for subgroups of 4, 8, 16, 32, 64 and 128 emulated in workgroup memory. Run so, with digits of 4 and 8 bits where they have room, and with
 * sizes other than the announced least; `npm test` has 32.
 *
 * Passes: nothing needs subgroups: the one shader that votes is a variant of the sort, which must first give a known answer on the device. Sorted permutations are those of a
 * stable sort on the CPU for any keys, with every variant that the device has, and with subgroups of 4 to 128 threads whose votes are counted in workgroup memory.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import fc from 'fast-check';
import { canSort, constants, SORT_NAMES, SortStage, type SortName } from '@gaussian-splat/renderer/stages';
import { runCase } from '../support/gpu.js';
import { nodeDevice } from '../support/node-device.js';
import { fullDevice } from './support/devices.js';
import { deviceWithSubgroups } from './support/emulated-subgroups.js';
import { holds, sized } from './support/row.js';
import { planFor, stableOrder } from './support/sorting.js';
import { shaderTexts } from './support/sources.js';

test('nothing needs subgroups', () => {
  const users = [...shaderTexts()].filter(([, text]) =>
    /\bsubgroup[A-Z]|\bquad(?:Swap|Broadcast)|enable\s+subgroups/.test(text),
  );
  assert.deepEqual(
    users.map(([name]) => name),
    ['sort_scatter_subgroups.wgsl'],
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

/** Keys that a variant has misplaced, over random lists of them. */
async function misplaced(device: GPUDevice, variant: SortName, numRuns: number): Promise<number> {
  const stage = new SortStage(device, variant);
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
          bench.compute((pass) => stage.record(pass, bindings, plan));
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

for (const variant of SORT_NAMES) {
  test(`any keys, ${variant}`, async (context) => {
    const device = await (variant.startsWith('subgroup') ? fullDevice() : nodeDevice());
    if (!canSort(device, variant)) return context.skip(`this device has no subgroups for ${variant}`);
    const wrong = await misplaced(device, variant, sized(8, 400));
    holds('S15', `misplaced keys, ${variant}`, wrong, { atMost: 0, unit: 'keys' });
  });
}

/** Threads of a subgroup, and the least that the device announces: they differ where pipelines do. */
const SIZES: readonly (readonly [size: number, least: number])[] = sized(
  [[32, 32]],
  [
    [4, 4],
    [8, 8],
    [16, 16],
    [32, 32],
    [64, 64],
    [128, 128],
    [64, 4],
    [128, 32],
  ],
);

for (const [size, least] of SIZES) {
  test(`subgroups of ${size}, announced as ${least} or more`, async (context) => {
    const { device, changed } = await deviceWithSubgroups(size, least);
    if (!device.features.has('subgroups')) return context.skip('this device has no subgroups to take the place of');
    // Counts of eight-bit digits have room for no more than eight subgroups.
    const variants = (['subgroup4', 'subgroup8'] as const).filter((variant) => canSort(device, variant));
    assert.equal(variants.includes('subgroup8'), least >= 32);
    for (const variant of sized(variants.slice(-1), variants)) {
      const wrong = await misplaced(device, variant, sized(4, 100));
      holds('S15', `misplaced keys, ${variant}, subgroups of ${size} of ${least} or more`, wrong, {
        atMost: 0,
        unit: 'keys',
      });
    }
    assert.ok(changed.length > 0, 'the shader was changed');
    device.destroy();
  });
}
