import {
  constants,
  layouts,
  sortCount,
  sortCountSerial,
  sortScan,
  sortScanSerial,
  sortScatter,
  sortScatterSerial,
} from '../generated/shaders.js';
import { BUFFER_USAGE, kernelOf, perDevice, type ComputeKernel } from '../gpu/kernel.js';
import { writeStruct } from '../gpu/struct.js';
import type { Threads } from './stage.js';

/** Buffers of {@link SortStage}. */
export interface SortBuffers {
  /** `Plan`: the number of keys. */
  readonly plan: GPUBuffer;
  /** The input keys are in the first. Passes alternate between the two: see {@link sortedIn}. */
  readonly keys: readonly [GPUBuffer, GPUBuffer];
  /**
   * Values that move with the keys. Given words start in the first buffer, too. Indices are written by the first pass,
   * and end in the first buffer.
   */
  readonly values: readonly [GPUBuffer, GPUBuffer];
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
}

/** Bind groups of one pass over the keys. */
interface SortPass {
  readonly count: GPUBindGroup;
  readonly scan: GPUBindGroup;
  readonly scatter: GPUBindGroup;
}

const { DIGITS, DIGITS_PER_GROUP, DIGITS_PER_SERIAL_GROUP } = constants;
const MAX_KEY_BITS = 32;
const DIGIT_BITS = Math.log2(DIGITS);

/** Number of passes for keys of this many bits. */
const passCount = (keyBits: number): number => Math.max(1, Math.ceil(keyBits / DIGIT_BITS));

/** Value of a key: its index, or a word of the caller. */
export type SortValues = 'indices' | 'given';

/**
 * Index of the buffer, of keys and of given words, that holds the result for keys of this many bits: the first (0) or
 * the second (1).
 */
export const sortedIn = (keyBits: number): 0 | 1 => (passCount(keyBits) % 2 === 0 ? 0 : 1);

/**
 * Stable least-significant-digit radix sort of keys of up to 32 bits: for each digit a pass of count, scan, scatter.
 * Counts are reduced and scanned between dispatches, so no workgroup ever waits for another.
 */
export class SortStage {
  readonly #moving: SortValues;
  readonly #count: ComputeKernel<typeof sortCount> | ComputeKernel<typeof sortCountSerial>;
  readonly #scan: ComputeKernel<typeof sortScan> | ComputeKernel<typeof sortScanSerial>;
  readonly #scanGroups: number;
  readonly #scatter: ComputeKernel<typeof sortScatter> | ComputeKernel<typeof sortScatterSerial>;
  readonly #passUniforms: readonly GPUBuffer[];

  constructor(device: GPUDevice, threads: Threads = 'parallel', moving: SortValues = 'indices') {
    this.#moving = moving;
    const isSerial = threads === 'serial';
    this.#count = isSerial ? kernelOf(device, sortCountSerial) : kernelOf(device, sortCount);
    this.#scan = isSerial ? kernelOf(device, sortScanSerial) : kernelOf(device, sortScan);
    this.#scanGroups = Math.ceil(DIGITS / (isSerial ? DIGITS_PER_SERIAL_GROUP : DIGITS_PER_GROUP));
    this.#scatter = isSerial ? kernelOf(device, sortScatterSerial) : kernelOf(device, sortScatter);
    this.#passUniforms = perDevice(device, `sort passes ${moving}`, () => makePassUniforms(device, moving));
  }

  /** @param keyBits Number of low bits of a key to sort by; the others must be 0 or are ignored. */
  bind({ plan, keys, values, digitCounts, digitTotals }: SortBuffers, keyBits = MAX_KEY_BITS): readonly SortPass[] {
    const passes = passCount(keyBits);
    return this.#passUniforms.slice(0, passes).map((uniform, index) => {
      const [from, to] = index % 2 === 0 ? [0, 1] : [1, 0];
      const valuesTo = this.#moving === 'given' ? to : (passes - 1 - index) % 2;
      return {
        count: this.#count.bind({ digit_pass: uniform, plan, keys: keys[from], counts: digitCounts }),
        scan: this.#scan.bind({ plan, counts: digitCounts, digit_totals: digitTotals }),
        scatter: this.#scatter.bind({
          digit_pass: uniform,
          plan,
          keys_in: keys[from],
          values_in: values[1 - valuesTo],
          block_offsets: digitCounts,
          digit_totals: digitTotals,
          keys_out: keys[to],
          values_out: values[valuesTo],
        }),
      };
    });
  }

  /** @param most Maximum number of keys: blocks beyond the actual number end at once. */
  record(pass: GPUComputePassEncoder, bindings: readonly SortPass[], max: number): void {
    const blocks = Math.ceil(max / constants.SORT_BLOCK);
    for (const { count, scan, scatter } of bindings) {
      this.#count.dispatch(pass, count, blocks);
      this.#scan.dispatch(pass, scan, this.#scanGroups);
      this.#scatter.dispatch(pass, scatter, blocks);
    }
  }
}

export type SortBindings = ReturnType<SortStage['bind']>;

function makePassUniforms(device: GPUDevice, moving: SortValues): GPUBuffer[] {
  return Array.from({ length: MAX_KEY_BITS / DIGIT_BITS }, (_, index) => {
    const buffer = device.createBuffer({
      label: `gs.sort.pass_${index}`,
      size: 16,
      usage: BUFFER_USAGE.uniform,
      mappedAtCreation: true,
    });
    const makesIndices = index === 0 && moving === 'indices';
    const values = { shift: index * DIGIT_BITS, makes_indices: makesIndices ? 1 : 0 };
    writeStruct(layouts.SortPass, values, buffer.getMappedRange());
    buffer.unmap();
    return buffer;
  });
}
