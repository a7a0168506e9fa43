import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE, dispatchGrid } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import { sortedIn, SortStage, type SortName } from '../stages/sort.js';

/** Keys of a probe: several blocks, the last one not full. */
const COUNT = 3 * constants.SORT_BLOCK + 1234;
const KEY_BITS = 24;

/** True if the variant puts random keys, many of them equal, in the order that they should have. */
export async function sortsRight(device: GPUDevice, name: SortName): Promise<boolean> {
  const keys = probeKeys();
  const expected = Uint32Array.from(keys.keys()).sort((a, b) => keys[a] - keys[b] || a - b);
  const { order } = await sort(device, name, keys);
  return expected.every((index, rank) => order[rank] === index);
}

/** Milliseconds that the variant takes, waited for. */
export async function timeSort(device: GPUDevice, name: SortName): Promise<number> {
  return (await sort(device, name, probeKeys())).time;
}

function probeKeys(): Uint32Array<ArrayBuffer> {
  let state = 7;
  const random = (): number => (state = (state * 48271) % 0x7fffffff);
  return Uint32Array.from({ length: COUNT }, (_, i) => (i % 3 === 0 ? 4242 : random() & 0xffffff));
}

async function sort(
  device: GPUDevice,
  name: SortName,
  keys: Uint32Array<ArrayBuffer>,
): Promise<{ order: Uint32Array; time: number }> {
  const memory = new GpuMemory(device);
  const { storage, copySource, copyDestination, indirect, mapRead } = BUFFER_USAGE;
  const buffer = (bytes: number, content?: Uint32Array): GPUBuffer =>
    memory.buffer('gs.probe', bytes, storage | copySource | copyDestination | indirect, content);
  const blocks = Math.ceil(COUNT / constants.SORT_BLOCK);
  const plan = buffer(layouts.Plan.size + layouts.PagePlan.size, planWords(blocks));
  const values = [buffer(4 * COUNT), buffer(4 * COUNT)] as const;
  const keyBuffers = [buffer(4 * COUNT), buffer(4 * COUNT)] as const;
  const digitCounts = buffer(4 * constants.DIGITS * blocks);
  const digitTotals = buffer(4 * constants.DIGITS);
  const staging = memory.buffer('gs.probe', 4 * COUNT, mapRead | copyDestination);
  const stage = new SortStage(device, name);
  const bindings = stage.bind({ plan, keys: keyBuffers, values, digitCounts, digitTotals }, KEY_BITS);
  let time = Infinity;
  try {
    // The first run also makes the pipelines.
    for (let run = 0; run < 3; run++) {
      device.queue.writeBuffer(keyBuffers[0], 0, keys);
      await device.queue.onSubmittedWorkDone();
      const before = performance.now();
      const encoder = device.createCommandEncoder({ label: 'gs.probe' });
      const pass = encoder.beginComputePass({ label: 'gs.probe' });
      stage.record(pass, bindings, plan);
      pass.end();
      encoder.copyBufferToBuffer(values[sortedIn(name, KEY_BITS)], 0, staging, 0, 4 * COUNT);
      device.queue.submit([encoder.finish()]);
      await device.queue.onSubmittedWorkDone();
      time = Math.min(time, performance.now() - before);
    }
    await staging.mapAsync(0x1);
    return { order: new Uint32Array(staging.getMappedRange().slice(0)), time };
  } finally {
    memory.destroy();
  }
}

function planWords(blocks: number): Uint32Array {
  const words = new Uint32Array((layouts.Plan.size + layouts.PagePlan.size) / 4);
  const { visible, sort_blocks, sort_x, sort_y, sort_z } = layouts.Plan.fields;
  const [columns, rows] = dispatchGrid(blocks);
  words[visible.offset / 4] = COUNT;
  words[sort_blocks.offset / 4] = blocks;
  words[sort_x.offset / 4] = columns;
  words[sort_y.offset / 4] = rows;
  words[sort_z.offset / 4] = 1;
  return words;
}
