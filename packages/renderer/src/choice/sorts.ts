import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import { SortStage } from '../stages/sort.js';
import type { Threads } from '../stages/plan.js';

const { DIGITS, SORT_BLOCK } = constants;
/** So many that the sums over blocks are shared among threads; the last block is not full. */
const BLOCKS = 19;
const KEYS = BLOCKS * SORT_BLOCK - 100;

/** True if the sort puts keys of all digits in order, and equal ones in the order in which they came: more of them than a picture of the self-test has. */
export async function sorts(device: GPUDevice, threads: Threads): Promise<boolean> {
  const keys = Uint32Array.from({ length: KEYS }, (_, i) => Math.imul(i % 9001, 0x9e3779b1));
  const { fields, size } = layouts.Plan;
  const plan = new Uint32Array((size + layouts.PagePlan.size) / 4);
  plan[fields.visible.offset / 4] = KEYS;
  plan[fields.sort_blocks.offset / 4] = BLOCKS;
  const memory = new GpuMemory(device);
  const { storage, copySource, copyDestination, mapRead } = BUFFER_USAGE;
  const make = (bytes: number, words?: Uint32Array): GPUBuffer =>
    memory.buffer('gs.probe.sort', bytes, storage | copySource | copyDestination, words);
  const values = [make(keys.byteLength), make(keys.byteLength)] as const;
  const stage = new SortStage(device, threads);
  const passes = stage.bind({
    plan: make(plan.byteLength, plan),
    keys: [make(keys.byteLength, keys), make(keys.byteLength)],
    values,
    digitCounts: make(4 * DIGITS * BLOCKS),
    digitTotals: make(4 * DIGITS),
  });
  const staging = memory.buffer('gs.probe.sort', keys.byteLength, mapRead | copyDestination);
  const encoder = device.createCommandEncoder({ label: 'gs.probe.sort' });
  const pass = encoder.beginComputePass({ label: 'gs.probe.sort' });
  stage.record(pass, passes, KEYS);
  pass.end();
  encoder.copyBufferToBuffer(values[0], 0, staging, 0, keys.byteLength);
  device.queue.submit([encoder.finish()]);
  try {
    await staging.mapAsync(0x1);
    const order = new Uint32Array(staging.getMappedRange());
    // Strictly ascending by key and place: then each place is there once.
    return order.every((place, i) => {
      const [key, before] = [keys[place], keys[order[i - 1]]];
      return place < KEYS && (i === 0 || before < key || (before === key && order[i - 1] < place));
    });
  } finally {
    memory.destroy();
  }
}
