import { packWithDetail, type PackedGaussians } from '@gaussian-splat/renderer';
import {
  cameraValues,
  constants,
  CullChunksStage,
  cullGroups,
  DetailBudgetStage,
  layouts,
  SH_PRECISION,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { levelStarts, pathOf, screenError, shareDrawn, type DetailView } from '../../support/detail-twin.js';
import { check, randomSource, type Bench, type StageCase } from '../../support/gpu.js';
import { cameraAt } from '../../support/scenes.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { WITHOUT_LEVERS } from './view.js';

const NOT_WRITTEN = -1;

interface Cut {
  /** Of each chunk; {@link NOT_WRITTEN} for those that are not looked into. */
  readonly shares: Float32Array;
  readonly listed: ReadonlySet<number>;
  /** Pixels that the budget allows. */
  readonly allowed: number;
}

/** Chunks that are drawn, and to what share; with a budget, the pixels that it allows as well. */
async function cutOnGpu(bench: Bench, packed: PackedGaussians, view: DetailView, budget = 0): Promise<Cut> {
  const groups = cullGroups(packed.count);
  const words = viewWords(packed, view, budget);
  const [uniform, chunks] = [bench.uniform(...words), bench.buffer(new Uint32Array(packed.chunks.buffer))];
  const details = bench.buffer(new Uint32Array(packed.details!.buffer));
  const initial = new Float32Array(groups + 1).fill(NOT_WRITTEN);
  initial[groups] = 0;
  const shares = bench.buffer(new Uint32Array(initial.buffer));
  const [list, args] = [bench.buffer(4 * groups), bench.buffer(Uint32Array.of(0, 1, 1))];
  const counts = bench.buffer(4 * constants.DETAIL_COUNTS);
  const [stage, budgetStage] = [new CullChunksStage(bench.device), new DetailBudgetStage(bench.device)];
  const bindings = stage.bind({
    ...{ view: uniform, chunks, details, chunk_shares: shares, chunk_list: list, chunk_args: args },
    group_counts: bench.buffer(4 * groups),
    visible_bits: bench.buffer(4 * constants.WORDS_PER_GROUP * groups),
  });
  const counting = budgetStage.bindCount({ view: uniform, chunks, details, detail_counts: counts });
  const allowing = budgetStage.bindAllow({ view: uniform, detail_counts: counts, chunk_shares: shares });
  bench.compute((pass) => {
    if (budget > 0) {
      budgetStage.recordCount(pass, counting, packed.count);
      budgetStage.recordAllow(pass, allowing);
    }
    stage.record(pass, bindings, packed.count);
  });
  const found = new Float32Array((await bench.read(shares)).buffer);
  const [count] = await bench.read(args);
  return {
    shares: found,
    listed: new Set((await bench.read(list)).subarray(0, count)),
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
      ...{ splat_count: count, page: 0, first_group: 0, antialiased: 0, key_bits: 24, is_ordered: 0 },
      ...{ sh_degree: shDegree, sh_cap: 3, sh_encoding: SH_PRECISION[shPrecision], occlusion_tiles: [0, 0] },
      ...{ ...WITHOUT_LEVERS, has_detail: 1, detail: allowed, detail_fade: fade, splat_budget: budget },
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

/** The sum of shares along the path of each leaf, as the twin has them where the GPU did not look. */
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
      // Where a share changes fast, the rounding of a distance shows.
      const slack = 1e-3 / Math.max(view.fade, 0.05);
      const isOnEdge = view.fade < 0.05 && isNearEdge(rows, chunk, view);
      check(isOnEdge || Math.abs(share - twin) <= slack, `${what}: chunk ${chunk} has ${share}, expected ${twin}`);
      sum += share;
      if (share > 0) drawn++;
    }
    check(Math.abs(sum - 1) < 1e-4, `${what}: leaf ${leaf} is covered ${sum} times`);
    if (view.fade === 0) check(drawn === 1, `${what}: leaf ${leaf} is drawn by ${drawn} chunks`);
  }
  return looked;
}

function isNearEdge(rows: Float32Array, chunk: number, { camera, allowed, fade }: DetailView): boolean {
  const near = (pixels: number): boolean => Math.abs(Math.log2(pixels / allowed)) < fade + 1e-4;
  return near(screenError(rows, chunk, camera, false)) || near(screenError(rows, chunk, camera, true));
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
      check(looked > 1000, `only ${looked} chunks were looked into`);
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
    name: 'detail: a budget of splats is kept, and allows an error that moves with it',
    async run(bench) {
      const random = randomSource(13);
      for (let k = 0; k < 12; k++) {
        const view = { ...randomView(random, 2 * k), allowed: 0, fade: 0.5 };
        const budgets = [2_000, 2_100, 6_000, 6_100, 15_000, 60_000];
        const all = (await cutOnGpu(bench, packed, view)).listed.size * constants.CULL_GROUP;
        let last = Infinity;
        for (const budget of budgets) {
          const { listed, allowed } = await cutOnGpu(bench, packed, view, budget);
          const splats = listed.size * constants.CULL_GROUP;
          // A chunk at its end may be partly filled, and is counted as such.
          check(splats <= budget + constants.CULL_GROUP, `view ${k}: ${splats} splats for a budget of ${budget}`);
          check(allowed <= last, `view ${k}: budget ${budget} allows ${allowed}, a smaller one ${last}`);
          // While levels fade into one another both are looked at.
          if (budget > 1.4 * all) check(allowed === 0, `view ${k}: ${allowed} although all ${all} splats have room`);
          last = allowed;
        }
      }
    },
  },
];
