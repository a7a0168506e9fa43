/** Tests stages in isolation, with more data than a small image provides. */
import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import { SortStage } from '../stages/sort.js';
import { planStage, scanBytes, type Threads } from '../stages/stage.js';

const { DIGITS, SORT_BLOCK } = constants;
/**
 * Number of blocks of the sort. The sums over blocks are divided among threads, and the last block is partly filled.
 */
const BLOCKS = 19;
const KEYS = BLOCKS * SORT_BLOCK - 100;
/** Number of counts for the prefix sums: more than a workgroup sums in one step. */
const COUNTS = 5_003;
const WORD = 4;

/** Resolves to whether prefix sums and sorting are correct for more numbers than an image of the self-test has. */
export async function sumsAndSorts(device: GPUDevice, threads: Threads): Promise<boolean> {
  const memory = new GpuMemory(device);
  const { storage, uniform, copySource, copyDestination, mapRead } = BUFFER_USAGE;
  const make = (content: number | Uint32Array, usage: number = storage): GPUBuffer => {
    const [bytes, words] = typeof content === 'number' ? [content, undefined] : [content.byteLength, content];
    return memory.buffer('gs.probe', bytes, usage | copySource | copyDestination, words);
  };
  const keys = new Uint32Array(KEYS);
  for (let i = 0; i < KEYS; i++) keys[i] = Math.imul(i % 9001, 0x9e3779b1);
  const order = [make(keys.byteLength), make(keys.byteLength)] as const;
  const sort = new SortStage(device, threads);
  const passes = sort.bind({
    plan: make(planOf(KEYS)),
    keys: [make(keys), make(keys.byteLength)],
    values: order,
    digitCounts: make(WORD * DIGITS * BLOCKS),
    digitTotals: make(WORD * DIGITS),
  });
  const counts = new Uint32Array(scanBytes(COUNTS) / WORD).map((_, i) => (7 * i) % 257);
  const values = make(counts);
  const plan = planStage(device, threads);
  const sums = plan.bind({
    values,
    limits: make(Uint32Array.of(1, 0xffffffff, COUNTS, 0), uniform),
    page_ranges: make(Uint32Array.of(0, COUNTS)),
    plan: make(planOf(0)),
  });
  const staging = memory.buffer('gs.probe', WORD * (KEYS + COUNTS), mapRead | copyDestination);
  const encoder = device.createCommandEncoder({ label: 'gs.probe' });
  const pass = encoder.beginComputePass({ label: 'gs.probe' });
  sort.record(pass, passes, KEYS);
  plan.record(pass, sums);
  pass.end();
  encoder.copyBufferToBuffer(order[0], 0, staging, 0, WORD * KEYS);
  encoder.copyBufferToBuffer(values, 0, staging, WORD * KEYS, WORD * COUNTS);
  device.queue.submit([encoder.finish()]);
  try {
    await staging.mapAsync(0x1);
    const found = new Uint32Array(staging.getMappedRange());
    return isOrder(found.subarray(0, KEYS), keys) && areSums(found.subarray(KEYS), counts);
  } finally {
    memory.destroy();
  }
}

function planOf(keys: number): Uint32Array {
  const { fields, size } = layouts.Plan;
  const plan = new Uint32Array((size + layouts.PagePlan.size) / WORD);
  plan[fields.visible.offset / WORD] = keys;
  plan[fields.sort_blocks.offset / WORD] = Math.ceil(keys / SORT_BLOCK);
  return plan;
}

/** Whether indices are strictly ascending by key and index: every index then occurs once. */
function isOrder(order: Uint32Array, keys: Uint32Array): boolean {
  for (let i = 0; i < order.length; i++) {
    if (order[i] >= KEYS) return false;
    if (i === 0) continue;
    const before = keys[order[i - 1]];
    const key = keys[order[i]];
    if (before > key || (before === key && order[i - 1] >= order[i])) return false;
  }
  return true;
}

function areSums(found: Uint32Array, counts: Uint32Array): boolean {
  let sum = 0;
  for (let i = 0; i < found.length; i++) {
    if (found[i] !== sum) return false;
    sum += counts[i];
  }
  return true;
}
