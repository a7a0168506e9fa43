import type { PackedGaussians } from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';
import {
  cameraValues,
  constants,
  cullChunksStage,
  cullGroups,
  detailBudgetOn,
  layouts,
  SH_PRECISION,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { levelStarts, pathOf, screenError, shareDrawn, type DetailView } from '../../support/detail-twin.js';
import { check, randomSource, type Bench, type StageCase } from '../../support/gpu.js';
import { miscompiling, type Miscompilation } from '../../support/miscompilation.js';
import { cameraAt } from '../../support/scenes.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { DEFAULT_SETTINGS } from './view.js';

const NOT_WRITTEN = -1;

interface Cut {
  /** Value of each chunk; 0 for those that are not drawn. */
  readonly shares: Float32Array;
  readonly listed: ReadonlySet<number>;
  /** Pixels that the budget allows. */
  readonly allowed: number;
}

/** Chunks that are drawn, and to what share; with a budget, the pixels that it allows as well. */
async function cutOnGpu(
  bench: Bench,
  packed: PackedGaussians,
  view: DetailView,
  { budget = 0, device = bench.device }: { budget?: number; device?: GPUDevice } = {},
): Promise<Cut> {
  const groups = cullGroups(packed.count);
  const words = viewWords(packed, view, budget);
  const [uniform, chunks] = [bench.uniform(...words), bench.buffer(new Uint32Array(packed.chunks.buffer))];
  const details = bench.buffer(new Uint32Array(packed.details!.buffer));
  const initial = new Float32Array(groups + 1).fill(NOT_WRITTEN);
  initial[groups] = 0;
  const shares = bench.buffer(new Uint32Array(initial.buffer));
  const counts = bench.buffer(4 * constants.DETAIL_COUNTS);
  const [stage, budgetStage] = [cullChunksStage(device), detailBudgetOn(device)];
  const bindings = stage.bind({
    ...{ view: uniform, chunks, details, chunk_shares: shares },
    group_counts: bench.buffer(4 * groups),
    visible_bits: bench.buffer(4 * constants.WORDS_PER_GROUP * groups),
  });
  const counting = budgetStage.count.bind({ view: uniform, chunks, details, detail_counts: counts });
  const allowing = budgetStage.threshold.bind({ view: uniform, detail_counts: counts, chunk_shares: shares });
  bench.compute((pass) => {
    if (budget > 0) {
      budgetStage.count.record(pass, counting, packed.count);
      budgetStage.threshold.record(pass, allowing);
    }
    stage.record(pass, bindings, packed.count);
  });
  const found = new Float32Array((await bench.read(shares)).buffer);
  return {
    shares: found,
    listed: new Set(Array.from({ length: groups }, (_, chunk) => chunk).filter((chunk) => found[chunk] > 0)),
    allowed: found[groups],
  };
}

function viewWords(packed: PackedGaussians, { camera, allowed, fade }: DetailView, budget: number): Uint32Array {
  const bytes = new ArrayBuffer(layouts.View.size);
  const { shDegree, shPrecision, origin, count } = packed;
  writeStruct(
    layouts.View,
    {
      ...cameraValues(camera, origin),
      ...{ splat_count: count, page: 0, first_group: 0, antialiased: 0, key_bits: 24 },
      ...{ sh_degree: shDegree, sh_cap: 3, sh_encoding: SH_PRECISION[shPrecision] },
      ...{ ...DEFAULT_SETTINGS, has_detail: 1, detail: allowed, detail_fade: fade, splat_budget: budget },
    },
    bytes,
  );
  return new Uint32Array(bytes);
}

/** Cameras in the scene, near it and far away, that look anywhere or at all of it. */
function randomView(random: () => number, k: number): DetailView {
  const distance = 0.2 * 2 ** (9 * random());
  const angle = 2 * Math.PI * random();
  const eye = [distance * Math.cos(angle), -distance * (random() - 0.2), distance * Math.sin(angle)] as const;
  const target = k % 2 === 0 ? ([0, 0, 0] as const) : ([random() * 8 - 4, random() - 0.5, random() * 8 - 4] as const);
  const camera = cameraAt([...eye], [...target], { fovXDegrees: 20 + 100 * random(), near: 0.01 });
  const allowed = k % 5 === 0 ? 0 : 0.05 * 2 ** (8 * random());
  return { camera, allowed, fade: k % 3 === 0 ? 0 : random() };
}

const packed = packWithDetail(pebbles(30_000));

/** The sum of weights along the path of each leaf, from the twin for chunks that the GPU skipped. */
function checkCovered(cut: Cut, view: DetailView, what: string): number {
  const rows = packed.details!;
  const starts = levelStarts(packed);
  let looked = 0;
  for (let leaf = 0; leaf < starts[1]; leaf++) {
    let sum = 0;
    let drawn = 0;
    for (const chunk of pathOf(starts, leaf)) {
      const twin = shareDrawn(rows, chunk, view);
      const share = cut.listed.has(chunk) ? cut.shares[chunk] : twin;
      if (cut.listed.has(chunk)) looked++;
      // The rounding of a distance shows when a weight changes fast.
      const slack = 1e-3 / Math.max(view.fade, 0.05);
      const isOnEdge = view.fade < 0.05 && isNear(rows, chunk, view, view.fade + 1e-4);
      check(isOnEdge || Math.abs(share - twin) <= slack, `${what}: chunk ${chunk} has ${share}, expected ${twin}`);
      sum += share;
      if (share > 0) drawn++;
    }
    check(Math.abs(sum - 1) < 1e-4, `${what}: leaf ${leaf} is covered ${sum} times`);
    if (view.fade === 0) check(drawn === 1, `${what}: leaf ${leaf} is drawn by ${drawn} chunks`);
  }
  checkWhole(cut, view, what);
  return looked;
}

/**
 * Rounding error of a screen-space error in octaves: a distance from a sphere is a small difference of large numbers.
 */
const ROUNDING = 0.01;

/**
 * A chunk that is neither finer nor coarser than the fading levels is drawn fully or not at all: no check is wasted.
 */
function checkWhole({ listed, shares }: Cut, view: DetailView, what: string): void {
  for (const chunk of listed) {
    if (isNear(packed.details!, chunk, view, view.fade + ROUNDING)) continue;
    check(shares[chunk] === 1, `${what}: chunk ${chunk}, which does not fade, has a fraction of ${shares[chunk]}`);
  }
}

/** Whether the error of a chunk, or of the one above it, is within a number of octaves of the allowed error. */
function isNear(rows: Float32Array, chunk: number, { camera, allowed }: DetailView, octaves: number): boolean {
  return [false, true].some(
    (above) => Math.abs(Math.log2(screenError(rows, chunk, camera, above) / allowed)) < octaves,
  );
}

const CULL_CHUNKS = /gs\.cull_chunks/;

/** Quotients of one rounding more, and sums of products of one less: WGSL leaves both to compilers. */
const ROUNDED_OTHERWISE: readonly Miscompilation[] = [
  { shader: CULL_CHUNKS, from: 'd.error / d.full_error', to: 'd.error * (1.0 / d.full_error)' },
  { shader: CULL_CHUNKS, from: 'pixels / allowed', to: 'pixels * (1.0 / allowed)' },
  {
    shader: CULL_CHUNKS,
    from: 'length(sphere.xyz - view.eye)',
    to: 'length_fused(sphere.xyz - view.eye)',
  },
  {
    shader: CULL_CHUNKS,
    from: 'fn screen_error',
    to: 'fn length_fused(v: vec3f) -> f32 { return sqrt(fma(v.x, v.x, fma(v.y, v.y, v.z * v.z))); }\nfn screen_error',
  },
];

/**
 * The value that a chunk computes for itself is larger by 2^-21 than the one computed for the same chunk as a parent.
 */
const ROUNDED_APART: readonly Miscompilation[] = [
  { shader: CULL_CHUNKS, from: 'd.error / d.full_error', to: 'd.error * (1.0 / d.full_error)' },
  {
    shader: CULL_CHUNKS,
    from: 'refined(pixels, allowed, view.detail_fade)',
    to: 'refined(select(pixels * 1.00000048, pixels, is_above), allowed, view.detail_fade)',
  },
];

/** Draws random views with a compiler of that kind. */
async function checkMiscompiled(bench: Bench, faults: readonly Miscompilation[], fades: boolean): Promise<void> {
  const random = randomSource(14);
  const { device, befallen } = miscompiling(bench.device, faults);
  for (let k = 0; k < 40; k++) {
    const view = randomView(random, k);
    if (fades && view.fade < 0.1) continue;
    checkCovered(await cutOnGpu(bench, packed, view, { device }), view, `view ${k}`);
  }
  check(befallen.length === faults.length, `${befallen.length} of ${faults.length} changes were made`);
}

export const detailCases: readonly StageCase[] = [
  {
    name: 'detail: over 60 random views each leaf is covered exactly once, and shares are those of the twin',
    async run(bench) {
      const random = randomSource(11);
      let looked = 0;
      for (let k = 0; k < 60; k++) {
        const view = randomView(random, k);
        looked += checkCovered(await cutOnGpu(bench, packed, view), view, `view ${k}`);
      }
      check(looked > 1000, `only ${looked} chunks were read`);
    },
  },
  {
    name: 'detail: no error allowed draws the finest level and nothing else',
    async run(bench) {
      const random = randomSource(12);
      for (let k = 0; k < 10; k++) {
        const view = { ...randomView(random, 2 * k), allowed: 0, fade: 0.5 };
        const { listed, shares } = await cutOnGpu(bench, packed, view);
        for (const chunk of listed) {
          check(chunk < levelStarts(packed)[1] && shares[chunk] === 1, `chunk ${chunk}: share ${shares[chunk]}`);
        }
      }
    },
  },
  {
    name: 'detail: so it is where a compiler rounds quotients and sums of products otherwise',
    run: (bench) => checkMiscompiled(bench, ROUNDED_OTHERWISE, false),
  },
  {
    name: 'detail: where it does so for a chunk and not for the one above, only what fades is off, by a step',
    run: (bench) => checkMiscompiled(bench, ROUNDED_APART, true),
  },
  {
    name: 'detail: a budget of splats is kept, and allows an error that moves with it',
    async run(bench) {
      const random = randomSource(13);
      for (let k = 0; k < 12; k++) {
        const view = { ...randomView(random, 2 * k), allowed: 0, fade: 0.5 };
        const budgets = [2_000, 2_100, 6_000, 6_100, 15_000, 60_000];
        const all = (await cutOnGpu(bench, packed, view)).listed.size * constants.CULL_GROUP;
        let last = Infinity;
        for (const budget of budgets) {
          const { listed, allowed } = await cutOnGpu(bench, packed, view, { budget });
          const splats = listed.size * constants.CULL_GROUP;
          // A chunk at its end may be partly filled, and is counted as such.
          check(splats <= budget + constants.CULL_GROUP, `view ${k}: ${splats} splats for a budget of ${budget}`);
          check(allowed <= last, `view ${k}: budget ${budget} allows ${allowed}, a smaller one ${last}`);
          // While levels fade into one another, both are checked.
          if (budget > 1.4 * all) check(allowed === 0, `view ${k}: ${allowed} although all ${all} splats have room`);
          last = allowed;
        }
      }
    },
  },
];
