import type { Threads } from '@gaussian-splat/renderer/tools';
import { constants, kernelOf, layouts, sortedIn, sortScan, SortStage } from '@gaussian-splat/renderer/stages';
import { check, checkEqual, randomSource, type Bench, type StageCase } from '../../support/gpu.js';

/** The twin: indices of the keys in ascending order, equal keys in the order they came. */
function sortTwin(keys: Uint32Array): Uint32Array {
  return Uint32Array.from(keys.keys()).sort((a, b) => keys[a] - keys[b] || a - b);
}

/** A plan for `count` keys, as the plan stage writes it. */
function planFor(count: number): Uint32Array {
  const plan = new Uint32Array(layouts.Plan.size / 4 + layouts.PagePlan.size / 4);
  const blocks = Math.ceil(count / constants.SORT_BLOCK);
  const { fields } = layouts.Plan;
  plan[fields.visible.offset / 4] = count;
  plan[fields.sort_blocks.offset / 4] = blocks;
  return plan;
}

/** Sorts on the GPU; the buffers hold more than the keys, and data beyond them must stay. */
async function sortOnGpu(
  bench: Bench,
  keys: Uint32Array,
  threads: Threads = 'parallel',
  keyBits = 32,
): Promise<{ keys: Uint32Array; order: Uint32Array }> {
  const beyond = 64;
  const padded = new Uint32Array(keys.length + beyond).fill(0xdeadbeef);
  padded.set(keys);
  const plan = bench.buffer(planFor(keys.length));
  const pair = (first: Uint32Array): [GPUBuffer, GPUBuffer] => [
    bench.buffer(first),
    bench.buffer(new Uint32Array(padded.length).fill(0xdeadbeef)),
  ];
  const keyBuffers = pair(padded);
  const order = pair(new Uint32Array(padded.length).fill(0xdeadbeef));
  const stage = new SortStage(bench.device, threads);
  const buffers = {
    plan,
    keys: keyBuffers,
    values: order,
    digitCounts: bench.buffer(4 * constants.DIGITS * Math.max(1, Math.ceil(keys.length / constants.SORT_BLOCK))),
    digitTotals: bench.buffer(4 * constants.DIGITS),
  };
  const bindings = stage.bind(buffers, keyBits);
  // More blocks than there are keys: those beyond them end at once.
  bench.compute((pass) => stage.record(pass, bindings, keys.length + 3 * constants.SORT_BLOCK));
  const side = sortedIn(keyBits);
  const result = { keys: await bench.read(keyBuffers[side]), order: await bench.read(order[0]) };
  const rest = result.order.subarray(keys.length);
  check(
    rest.every((word) => word === 0xdeadbeef),
    'the sort wrote beyond its keys',
  );
  return result;
}

async function checkSort(bench: Bench, keys: Uint32Array, threads?: Threads, keyBits?: number): Promise<void> {
  const expected = sortTwin(keys);
  const sorted = await sortOnGpu(bench, keys, threads, keyBits);
  checkEqual(sorted.order, expected, 'order');
  checkEqual(
    sorted.keys,
    Uint32Array.from(expected, (i) => keys[i]),
    'keys',
  );
}

/** The exclusive sums over the blocks, digit by digit, and the totals of the digits. */
async function checkCountSums(bench: Bench, blocks: number): Promise<void> {
  const { DIGITS, DIGITS_PER_GROUP, SORT_BLOCK } = constants;
  const random = randomSource(blocks);
  const counts = fill(DIGITS * blocks, () => Math.floor(random() * SORT_BLOCK));
  const sums = new Uint32Array(counts.length);
  const totals = new Uint32Array(DIGITS);
  counts.forEach((count, i) => {
    sums[i] = totals[i % DIGITS];
    totals[i % DIGITS] += count;
  });
  const plan = bench.buffer(planFor(SORT_BLOCK * blocks));
  const [found, digitTotals] = [bench.buffer(counts), bench.buffer(4 * DIGITS)];
  const kernel = kernelOf(bench.device, sortScan);
  const bindings = kernel.bind({ plan, counts: found, digit_totals: digitTotals });
  bench.compute((pass) => kernel.dispatch(pass, bindings, DIGITS / DIGITS_PER_GROUP));
  checkEqual(await bench.read(found), sums, 'sums of the counts');
  checkEqual(await bench.read(digitTotals), totals, 'totals');
}

const fill = (count: number, value: (i: number) => number): Uint32Array =>
  Uint32Array.from({ length: count }, (_, i) => value(i));

const block = constants.SORT_BLOCK;
const sizes = [0, 1, 2, 255, 256, 257, block - 1, block, block + 1, 3 * block + 17];

export const sortCases: StageCase[] = [
  ...sizes.map((size) => ({
    name: `sort: ${size} random 32-bit keys`,
    run: (bench: Bench) => {
      const random = randomSource(size + 1);
      return checkSort(
        bench,
        fill(size, () => Math.floor(random() * 0x1_0000_0000)),
      );
    },
  })),
  {
    name: 'sort: counts of more blocks than are summed up at once',
    run: (bench) => checkCountSums(bench, 2 * constants.PREFIX_THREADS * constants.BLOCKS_PER_THREAD + 3),
  },
  ...(['parallel', 'serial'] as const).map((threads) => ({
    name: `sort, ${threads}: keys of 4 to 32 bits, many of them equal, blocks not full`,
    run: async (bench: Bench) => {
      for (const [keyBits, size] of [
        [4, 2 * block + 9],
        [7, 1000],
        [12, 3 * block],
        [24, block + 1],
        [32, 2 * block + 300],
      ]) {
        const random = randomSource(keyBits);
        const max = 2 ** keyBits;
        const keys = fill(size, (i) => (i % 3 === 0 ? max - 1 : Math.floor(random() * max)));
        await checkSort(bench, keys, threads, keyBits);
      }
    },
  })),
  {
    name: 'sort: is stable on equal keys',
    run: (bench) =>
      checkSort(
        bench,
        fill(5 * block + 3, () => 0x3f800000),
      ),
  },
  {
    name: 'sort: is stable on few distinct keys',
    run: (bench) => {
      const random = randomSource(5);
      return checkSort(
        bench,
        fill(4 * block + 100, () => Math.floor(random() * 5) * 0x01010101),
      );
    },
  },
  {
    name: 'sort: extremes 0 and 0xffffffff, ascending and descending runs',
    run: async (bench) => {
      await checkSort(
        bench,
        fill(2 * block + 1, (i) => (i % 2 === 0 ? 0xffffffff : 0)),
      );
      await checkSort(
        bench,
        fill(2 * block + 1, (i) => i),
      );
      await checkSort(
        bench,
        fill(2 * block + 1, (i) => 0xffffffff - i),
      );
    },
  },
  {
    name: 'sort: keys that differ in one byte only, for each byte',
    run: async (bench) => {
      for (const shift of [0, 8, 16, 24]) {
        const random = randomSource(shift);
        await checkSort(
          bench,
          fill(block + 77, () => (Math.floor(random() * 256) << shift) >>> 0),
        );
      }
    },
  },
  {
    name: 'sort: bits of positive floats order as the floats do',
    run: async (bench) => {
      const random = randomSource(11);
      const depths = Float32Array.from({ length: 3 * block }, () => Math.exp(40 * random() - 20));
      const { order } = await sortOnGpu(bench, new Uint32Array(depths.buffer));
      for (let i = 1; i < depths.length; i++)
        check(depths[order[i - 1]] <= depths[order[i]], `depths at ${i} are out of order`);
    },
  },
];
