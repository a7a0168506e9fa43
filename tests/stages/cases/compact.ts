import {
  compactStage,
  constants,
  cullGroups,
  layouts,
  planStage,
  scanBytes,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { check, checkEqual, randomSource, type Bench, type StageCase } from '../../support/gpu.js';

const { CULL_GROUP, WORDS_PER_GROUP } = constants;

/** Bits and exclusive group offsets as `cull` and `scan` leave them, for flags of one page after another. */
function flagsToBits(pages: readonly boolean[][]): {
  bits: Uint32Array;
  offsets: Uint32Array;
  firstGroups: Uint32Array;
} {
  const firstGroups = new Uint32Array(pages.length + 1);
  pages.forEach((flags, p) => (firstGroups[p + 1] = firstGroups[p] + cullGroups(flags.length)));
  const groups = firstGroups[pages.length];
  const bits = new Uint32Array(groups * WORDS_PER_GROUP);
  const offsets = new Uint32Array(groups + 1);
  pages.forEach((flags, p) => {
    flags.forEach((flag, i) => {
      const group = firstGroups[p] + Math.floor(i / CULL_GROUP);
      if (!flag) return;
      bits[group * WORDS_PER_GROUP + Math.floor((i % CULL_GROUP) / 32)] |= 1 << (i % 32);
      offsets[group + 1]++;
    });
  });
  for (let g = 0; g < groups; g++) offsets[g + 1] += offsets[g];
  return { bits, offsets, firstGroups };
}

/** The twin: indices of the flagged splats, pages counted as whole chunks, in order. */
function survivorsTwin(pages: readonly boolean[][]): number[] {
  const { firstGroups } = flagsToBits(pages);
  return pages.flatMap((flags, p) => flags.flatMap((flag, i) => (flag ? [firstGroups[p] * CULL_GROUP + i] : [])));
}

/** Lists the survivors of pages of the given sizes whose bits and offsets are known. */
async function compactBits(
  bench: Bench,
  { bits, offsets, firstGroups }: ReturnType<typeof flagsToBits>,
  counts: readonly number[],
  capacity: number,
): Promise<Uint32Array> {
  const stage = compactStage(bench.device);
  const survivors = bench.buffer(new Uint32Array(capacity).fill(0xffffffff));
  const [bitBuffer, offsetBuffer] = [bench.buffer(bits), bench.buffer(offsets)];
  counts.forEach((count, page) => {
    const bytes = new ArrayBuffer(layouts.View.size);
    const names = Object.keys(layouts.View.fields) as (keyof typeof layouts.View.fields)[];
    const zeros = Object.fromEntries(names.map((name) => [name, 0])) as Record<(typeof names)[number], number>;
    const place = { splat_count: count, page, first_group: firstGroups[page] };
    writeStruct(layouts.View, { ...zeros, ...place }, bytes);
    const view = bench.uniform(...new Uint32Array(bytes));
    const bindings = stage.bind({
      view,
      visible_bits: bitBuffer,
      group_offsets: offsetBuffer,
      survivors,
    });
    bench.compute((pass) => stage.record(pass, bindings, count));
  });
  return bench.read(survivors, 4 * capacity);
}

const compactOnGpu = (bench: Bench, pages: readonly boolean[][], capacity: number): Promise<Uint32Array> =>
  compactBits(
    bench,
    flagsToBits(pages),
    pages.map((flags) => flags.length),
    capacity,
  );

function randomFlags(count: number, share: number, seed: number): boolean[] {
  const random = randomSource(seed);
  return Array.from({ length: count }, () => random() < share);
}

async function checkPlan(bench: Bench, pages: readonly boolean[][], capacity: number): Promise<void> {
  const { offsets, firstGroups } = flagsToBits(pages);
  const groups = firstGroups[pages.length];
  const planSize = layouts.Plan.size + layouts.PagePlan.size * pages.length;
  const counts = new Uint32Array(scanBytes(groups) / 4);
  for (let group = 0; group < groups; group++) counts[group] = offsets[group + 1] - offsets[group];
  const total = survivorsTwin(pages).length;
  const visible = Math.min(total, capacity);
  for (const threads of ['parallel', 'serial'] as const) {
    const plan = bench.buffer(planSize);
    const stage = planStage(bench.device, threads);
    const bindings = stage.bind({
      limits: bench.uniform(pages.length, capacity, groups),
      values: bench.buffer(counts),
      page_ranges: bench.buffer(Uint32Array.from(pages.flatMap((_, p) => [firstGroups[p], firstGroups[p + 1]]))),
      plan,
    });
    bench.compute((pass) => stage.record(pass, bindings));
    const words = await bench.read(plan, planSize);
    const field = (name: keyof typeof layouts.Plan.fields): number => words[layouts.Plan.fields[name].offset / 4];
    checkEqual([field('visible'), field('overflow')], [visible, total - visible], 'visible and overflow');
    checkEqual([field('sort_blocks')], [Math.ceil(visible / constants.SORT_BLOCK)], 'blocks of the sort');
    let first = 0;
    pages.forEach((flags, page) => {
      const own = Math.max(0, Math.min(flags.filter(Boolean).length, visible - first));
      const at = (layouts.Plan.size + layouts.PagePlan.size * page) / 4;
      checkEqual(words.subarray(at, at + 2), [first, own], `page ${page}`);
      first += own;
    });
  }
}

const shares = [0, 0.01, 0.3, 1];

export const compactCases: StageCase[] = [
  ...shares.map((share) => ({
    name: `compact: keeps the order of ${100 * share} % survivors over several pages`,
    run: async (bench: Bench) => {
      const pages = [1000, 1, 256, 40_000].map((count, i) => randomFlags(count, share, i + 1));
      const expected = survivorsTwin(pages);
      const survivors = await compactOnGpu(bench, pages, 50_000);
      checkEqual(survivors, expected, 'survivors');
      check(
        survivors.subarray(expected.length).every((word) => word === 0xffffffff),
        'compact wrote beyond the survivors',
      );
    },
  })),
  {
    name: 'compact: over capacity, the first survivors stay and nothing else is touched',
    run: async (bench) => {
      const pages = [randomFlags(5000, 0.5, 9), randomFlags(3000, 0.5, 10)];
      const capacity = 1024;
      checkEqual(await compactOnGpu(bench, pages, capacity), survivorsTwin(pages).slice(0, capacity), 'survivors');
    },
  },
  {
    name: 'plan: counts and pages follow the survivors',
    run: async (bench) => {
      for (const share of shares) {
        await checkPlan(
          bench,
          [1000, 1, 256, 40_000].map((count, i) => randomFlags(count, share, i + 1)),
          50_000,
        );
      }
    },
  },
  {
    name: 'plan: over capacity the rest is counted as overflow',
    run: (bench) => checkPlan(bench, [randomFlags(5000, 0.5, 9), randomFlags(3000, 0.5, 10)], 1024),
  },
];
