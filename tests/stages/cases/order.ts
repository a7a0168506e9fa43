import { packGaussians } from '@gaussian-splat/renderer';
import {
  cameraValues,
  constants,
  cullGroups,
  layouts,
  OrderKeysStage,
  PlanStage,
  scanBytes,
  thinBlocks,
  ThinStage,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { cloudOf, repeat } from '../../support/clouds.js';
import { check, checkEqual, randomSource, type Bench, type StageCase } from '../../support/gpu.js';
import { cameraAt } from '../../support/scenes.js';
import { WITHOUT_LEVERS } from './view.js';

/** A random permutation of 0 ... count - 1. */
function permutation(count: number, seed: number): Uint32Array {
  const random = randomSource(seed);
  const order = Uint32Array.from({ length: count }, (_, i) => i);
  for (let i = count - 1; i > 0; i--) {
    const j = Math.floor(random() * (i + 1));
    [order[i], order[j]] = [order[j], order[i]];
  }
  return order;
}

async function checkThin(
  bench: Bench,
  threads: 'parallel' | 'serial',
  length: number,
  share: number,
  capacity: number,
): Promise<void> {
  const order = permutation(length, length);
  const random = randomSource(length + 1);
  const flags = Array.from({ length }, () => random() < share);
  const bits = new Uint32Array(Math.ceil(length / 32));
  flags.forEach((flag, i) => (bits[i >> 5] |= flag ? 1 << (i & 31) : 0));
  const blocks = thinBlocks(length);
  const survivors = bench.buffer(new Uint32Array(capacity).fill(0xffffffff));
  const blockOffsets = bench.buffer(scanBytes(blocks));
  const stage = new ThinStage(bench.device, threads);
  const bindings = stage.bind({
    thin: bench.uniform(length, 0, 0, 0),
    order: bench.buffer(order),
    visibleBits: bench.buffer(bits),
    blockOffsets,
    survivors,
  });
  const planStage = new PlanStage(bench.device, threads);
  const planning = planStage.bind({
    values: blockOffsets,
    limits: bench.uniform(1, capacity, blocks),
    page_ranges: bench.buffer(Uint32Array.of(0, blocks)),
    plan: bench.buffer(layouts.Plan.size + layouts.PagePlan.size),
  });
  bench.compute((pass) => {
    stage.recordCount(pass, bindings, length);
    planStage.record(pass, planning);
    stage.recordWrite(pass, bindings, length);
  });
  const expected = Array.from(order).filter((i) => flags[i]);
  checkEqual([(await bench.read(blockOffsets))[blocks]], [expected.length], 'total');
  const found = await bench.read(survivors, 4 * capacity);
  checkEqual(found, expected.slice(0, capacity), 'survivors');
  check(
    found.subarray(expected.length).every((word) => word === 0xffffffff),
    'thinning wrote beyond the survivors',
  );
}

export const orderCases: readonly StageCase[] = [
  ...(['parallel', 'serial'] as const).flatMap((threads): StageCase[] => [
    ...[0, 0.1, 0.5, 1].map((share) => ({
      name: `thin, ${threads}: keeps the order of ${100 * share} % survivors`,
      run: async (bench: Bench) => {
        for (const length of [256, 2048, 2304, 50_176]) await checkThin(bench, threads, length, share, length);
      },
    })),
    {
      name: `thin, ${threads}: over capacity the nearest survivors stay and nothing else is touched`,
      run: (bench) => checkThin(bench, threads, 20_224, 0.5, 1000),
    },
  ]),
  {
    name: 'order keys: grow with depth on both sides of the camera, what fills up the last chunk last of all',
    run: async (bench) => {
      const random = randomSource(5);
      const cloud = cloudOf(
        repeat(700, () => ({
          position: [8 * (random() - 0.5), 8 * (random() - 0.5), 20 * (random() - 0.5)],
          scale: 0.1,
          opacity: 0.5,
          color: [0, 0, 0],
        })),
      );
      const camera = cameraAt([1, 2, -3], [0, 0, 1], { width: 64, height: 48 });
      const packed = packGaussians(cloud);
      const bytes = new ArrayBuffer(layouts.View.size);
      const flags = {
        sh_degree: 0,
        sh_cap: 3,
        sh_encoding: 0,
        antialiased: 0,
        key_bits: 32,
        is_ordered: 1,
      };
      const firstGroup = 2;
      const page = { splat_count: packed.count, page: 0, first_group: firstGroup };
      writeStruct(
        layouts.View,
        { ...cameraValues(camera, packed.origin), ...flags, ...page, ...WITHOUT_LEVERS },
        bytes,
      );
      const length = constants.CULL_GROUP * (firstGroup + cullGroups(packed.count));
      const keys = bench.buffer(4 * length);
      const stage = new OrderKeysStage(bench.device);
      const view = bench.uniform(...new Uint32Array(bytes));
      const bindings = stage.bind({ view, gaussians: bench.buffer(packed.geometry), keys });
      bench.compute((pass) => stage.record(pass, bindings, packed.count));
      const own = (await bench.read(keys, 4 * length)).subarray(constants.CULL_GROUP * firstGroup);
      const floats = new Float32Array(packed.geometry.buffer);
      const m = camera.worldToCamera;
      const depth = (i: number): number =>
        m[8] * floats[8 * i] + m[9] * floats[8 * i + 1] + m[10] * floats[8 * i + 2] + m[11];
      const byKey = Array.from({ length: packed.count }, (_, i) => i).sort((a, b) => own[a] - own[b]);
      let behind = 0;
      for (let k = 1; k < byKey.length; k++) {
        check(depth(byKey[k]) >= depth(byKey[k - 1]) - 1e-5, `rank ${k} lies before rank ${k - 1}`);
        behind += depth(byKey[k]) < 0 ? 1 : 0;
      }
      check(behind > 50 && behind < 650, `${behind} splats behind the camera: the case tests nothing`);
      check(
        own.subarray(packed.count).every((key) => key === 0xffffffff),
        'what fills up the last chunk has a key',
      );
    },
  },
];
