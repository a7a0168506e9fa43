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

/** Buffers that a {@link SortStage} reads and writes. */
export interface SortBuffers {
  /** `Plan`, which contains the number of keys. */
  readonly plan: GPUBuffer;
  /**
   * Keys. The first buffer contains the input. Passes alternate between the two buffers; {@link sortedIn} returns the
   * one that contains the result.
   */
  readonly keys: readonly [GPUBuffer, GPUBuffer];
  /**
   * Values that move with the keys. For `given` values the first buffer contains the input, and the result is in the
   * same buffer as the keys. For `indices` the first pass writes them, and the first buffer contains the result.
   */
  readonly values: readonly [GPUBuffer, GPUBuffer];
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
}

/** Bind groups of one pass over a digit of the keys. */
interface SortPass {
  readonly count: GPUBindGroup;
  readonly scan: GPUBindGroup;
  readonly scatter: GPUBindGroup;
}

const { DIGITS, DIGITS_PER_GROUP, DIGITS_PER_SERIAL_GROUP } = constants;
const MAX_KEY_BITS = 32;
const DIGIT_BITS = Math.log2(DIGITS);

/** Returns the number of passes for keys of `keyBits` bits. */
const passCount = (keyBits: number): number => Math.max(1, Math.ceil(keyBits / DIGIT_BITS));

/** Values that are sorted: the indices of the keys, or words of the caller. */
export type SortValues = 'indices' | 'given';

/**
 * Returns the index of the buffer that contains the sorted keys and given values, for keys of `keyBits` bits: 0 or 1.
 */
export const sortedIn = (keyBits: number): 0 | 1 => (passCount(keyBits) % 2 === 0 ? 0 : 1);

/**
 * Stable radix sort of keys of up to 32 bits, from the least significant digit. Each pass counts, scans and scatters
 * one digit. Counts are reduced and scanned between dispatches, so that no workgroup waits for another.
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

  /**
   * Returns the bind groups of all passes. @param keyBits Number of low bits that keys are sorted by; higher bits are
   * ignored.
   */
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

  /** Records all passes. @param max Maximum number of keys; workgroups beyond the actual number end at once. */
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
