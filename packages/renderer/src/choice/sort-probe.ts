import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE, dispatchGrid } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import type { PassTimer } from '../gpu/pass-timer.js';
import { SortStage, type SortBindings, type SortName } from '../stages/sort.js';
import type { FrameClock } from './frame-clock.js';

/** Keys whose order is checked: several blocks, the last one not full. */
const CHECKED = 3 * constants.SORT_BLOCK + 1234;
const KEY_BITS = 24;
/** Timed runs; the first also makes the pipelines. */
const RUNS = 4;

/** True if the variant puts random keys, many of them equal, in the order that they should have. */
export async function sortsRight(device: GPUDevice, name: SortName): Promise<boolean> {
  const keys = probeKeys(CHECKED);
  const expected = Uint32Array.from(keys.keys()).sort((a, b) => keys[a] - keys[b] || a - b);
  const sorting = new ProbedSort(device, name, keys);
  try {
    sorting.run();
    const order = await sorting.read();
    return expected.every((index, rank) => order[rank] === index);
  } finally {
    sorting.destroy();
  }
}

/** Milliseconds that the variant takes for so many keys, the fastest of a few runs. */
export async function timeSort(device: GPUDevice, name: SortName, count: number, clock: FrameClock): Promise<number> {
  const sorting = new ProbedSort(device, name, probeKeys(count));
  let best = Infinity;
  try {
    for (let run = 0; run < RUNS; run++) {
      const time = await clock.time((timer) => sorting.run(timer));
      if (run > 0) best = Math.min(best, time);
    }
    return best;
  } finally {
    sorting.destroy();
  }
}

function probeKeys(count: number): Uint32Array<ArrayBuffer> {
  let state = 7;
  const random = (): number => (state = (state * 48271) % 0x7fffffff);
  return Uint32Array.from({ length: count }, (_, i) => (i % 3 === 0 ? 4242 : random() & 0xffffff));
}

/** A variant with keys of its own to sort. */
class ProbedSort {
  readonly #device: GPUDevice;
  readonly #memory: GpuMemory;
  readonly #keys: Uint32Array<ArrayBuffer>;
  readonly #unsorted: GPUBuffer;
  readonly #sorted: GPUBuffer;
  readonly #plan: GPUBuffer;
  readonly #stage: SortStage;
  readonly #bindings: SortBindings;

  constructor(device: GPUDevice, name: SortName, keys: Uint32Array<ArrayBuffer>) {
    this.#device = device;
    this.#keys = keys;
    this.#memory = new GpuMemory(device);
    const { storage, copySource, copyDestination, indirect } = BUFFER_USAGE;
    const buffer = (bytes: number, content?: Uint32Array): GPUBuffer =>
      this.#memory.buffer('gs.probe', bytes, storage | copySource | copyDestination | indirect, content);
    const blocks = Math.ceil(keys.length / constants.SORT_BLOCK);
    this.#plan = buffer(layouts.Plan.size + layouts.PagePlan.size, planWords(keys.length, blocks));
    const values = [buffer(keys.byteLength), buffer(keys.byteLength)] as const;
    const keyBuffers = [buffer(keys.byteLength), buffer(keys.byteLength)] as const;
    const digitCounts = buffer(4 * constants.DIGITS * blocks);
    const digitTotals = buffer(4 * constants.DIGITS);
    this.#unsorted = keyBuffers[0];
    this.#sorted = values[0];
    this.#stage = new SortStage(device, name);
    this.#bindings = this.#stage.bind(
      { plan: this.#plan, keys: keyBuffers, values, digitCounts, digitTotals },
      KEY_BITS,
    );
  }

  run(timer?: PassTimer): void {
    this.#device.queue.writeBuffer(this.#unsorted, 0, this.#keys);
    timer?.startFrame();
    const encoder = this.#device.createCommandEncoder({ label: 'gs.probe' });
    const pass = encoder.beginComputePass({ label: 'gs.probe', timestampWrites: timer?.timestampWrites('sort') });
    this.#stage.record(pass, this.#bindings, this.#plan);
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
  }

  async read(): Promise<Uint32Array> {
    const { mapRead, copyDestination } = BUFFER_USAGE;
    const { size } = this.#sorted;
    const staging = this.#memory.buffer('gs.probe', size, mapRead | copyDestination);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.probe' });
    encoder.copyBufferToBuffer(this.#sorted, 0, staging, 0, size);
    this.#device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    return new Uint32Array(staging.getMappedRange().slice(0));
  }

  destroy(): void {
    this.#memory.destroy();
  }
}

function planWords(count: number, blocks: number): Uint32Array {
  const words = new Uint32Array((layouts.Plan.size + layouts.PagePlan.size) / 4);
  const { visible, sort_blocks, sort_x, sort_y, sort_z } = layouts.Plan.fields;
  const [columns, rows] = dispatchGrid(blocks);
  words[visible.offset / 4] = count;
  words[sort_blocks.offset / 4] = blocks;
  words[sort_x.offset / 4] = columns;
  words[sort_y.offset / 4] = rows;
  words[sort_z.offset / 4] = 1;
  return words;
}
