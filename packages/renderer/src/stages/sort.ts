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
import {
  BUFFER_USAGE,
  kernelOf,
  perDevice,
  specialise,
  type ComputeKernel,
  type ShaderDescription,
} from '../gpu/kernel.js';
import { writeStruct } from '../gpu/struct.js';
import { planOffsets } from '../scratch.js';
import type { Threads } from './threads.js';

/** The buffers that {@link SortStage} works on. */
export interface SortBuffers {
  /** `Plan`: how many keys there are, and the indirect arguments. */
  readonly plan: GPUBuffer;
  /** The keys lie in the first. Passes go back and forth between the two: see {@link sortedIn}. */
  readonly keys: readonly [GPUBuffer, GPUBuffer];
  /** What moves along with the keys, likewise. Indices need not be there at first: the first pass makes them. */
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
const DIGIT_BITS = Math.log2(DIGITS);
const MAX_KEY_BITS = 32;

/** Passes that keys of so many bits take. */
const passCount = (keyBits: number): number => Math.max(1, Math.ceil(keyBits / DIGIT_BITS));

/** What moves along with a key: its index, or two words of the caller's. */
export type SortValues = 'indices' | 'pairs';

/** Which of the two key and value buffers holds the result for keys of so many bits: the first (0) or the second (1). */
export const sortedIn = (keyBits: number): 0 | 1 => (passCount(keyBits) % 2 === 0 ? 0 : 1);

/**
 * Stable least-significant-digit radix sort of keys of up to 32 bits: for each 8 bits a pass of count, scan, scatter.
 * Counts are reduced and scanned between dispatches, so no workgroup ever waits for another.
 */
export class SortStage {
  readonly #count: ComputeKernel<typeof sortCount> | ComputeKernel<typeof sortCountSerial>;
  readonly #scan: ComputeKernel<typeof sortScan> | ComputeKernel<typeof sortScanSerial>;
  readonly #scanGroups: number;
  readonly #scatter: ComputeKernel<typeof sortScatter> | ComputeKernel<typeof sortScatterSerial>;
  readonly #passUniforms: readonly GPUBuffer[];

  constructor(device: GPUDevice, moving: SortValues = 'indices', threads: Threads = 'parallel') {
    const isSerial = threads === 'serial';
    this.#count = isSerial ? kernelOf(device, sortCountSerial) : kernelOf(device, sortCount);
    this.#scan = isSerial ? kernelOf(device, sortScanSerial) : kernelOf(device, sortScan);
    this.#scanGroups = DIGITS / (isSerial ? DIGITS_PER_SERIAL_GROUP : DIGITS_PER_GROUP);
    this.#scatter = isSerial
      ? kernelOf(device, movingShader(sortScatterSerial, moving))
      : kernelOf(device, movingShader(sortScatter, moving));
    this.#passUniforms = perDevice(device, `sort passes ${moving}`, () => makePassUniforms(device, moving));
  }

  /** @param keyBits how many of the lowest bits of a key count; the others must be 0 or are ignored. */
  bind({ plan, keys, values, digitCounts, digitTotals }: SortBuffers, keyBits = MAX_KEY_BITS): readonly SortPass[] {
    return this.#passUniforms.slice(0, passCount(keyBits)).map((uniform, index) => {
      const [from, to] = index % 2 === 0 ? [0, 1] : [1, 0];
      return {
        count: this.#count.bind({ digit_pass: uniform, plan, keys: keys[from], counts: digitCounts }),
        scan: this.#scan.bind({ plan, counts: digitCounts, digit_totals: digitTotals }),
        scatter: this.#scatter.bind({
          digit_pass: uniform,
          plan,
          keys_in: keys[from],
          values_in: values[from],
          block_offsets: digitCounts,
          digit_totals: digitTotals,
          keys_out: keys[to],
          values_out: values[to],
        }),
      };
    });
  }

  record(pass: GPUComputePassEncoder, bindings: readonly SortPass[], plan: GPUBuffer): void {
    for (const { count, scan, scatter } of bindings) {
      this.#count.dispatchIndirect(pass, count, plan, planOffsets.sort);
      this.#scan.dispatch(pass, scan, this.#scanGroups);
      this.#scatter.dispatchIndirect(pass, scatter, plan, planOffsets.sort);
    }
  }
}

export type SortBindings = ReturnType<SortStage['bind']>;

function movingShader<S extends ShaderDescription>(shader: S, moving: SortValues): S {
  return moving === 'indices' ? shader : specialise(shader, 'pairs', 'alias Value = u32', 'alias Value = vec2u');
}

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
