import {
  constants,
  layouts,
  sortCount,
  sortCountSerial,
  sortScan,
  sortScanSerial,
  sortScatter,
  sortScatterSerial,
  sortScatterSubgroups,
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

/** The buffers that {@link SortStage} works on. */
export interface SortBuffers {
  /** `Plan`: how many keys there are, and the indirect arguments. */
  readonly plan: GPUBuffer;
  /** The keys lie in the first. Passes go back and forth between the two: see {@link sortedIn}. */
  readonly keys: readonly [GPUBuffer, GPUBuffer];
  /** What moves along with the keys: given words likewise. Indices are made by the first pass, and end in the first buffer. */
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

const { DIGITS_PER_GROUP, DIGITS_PER_SERIAL_GROUP, SORT_BLOCK, SORT_THREADS } = constants;
const MAX_KEY_BITS = 32;

/**
 * How keys are sorted; the result is the same. `shared8` and `shared4` rank keys by bitmaps in workgroup memory, with digits of 8 or 4 bits;
 * `subgroup8` and `subgroup4` by votes of subgroups; `serial` has one thread for a block of keys.
 */
export type SortName = 'shared8' | 'shared4' | 'subgroup8' | 'subgroup4' | 'serial';

export const SORT_NAMES: readonly SortName[] = ['shared8', 'shared4', 'subgroup8', 'subgroup4', 'serial'];

const digitBits = (name: SortName): 4 | 8 => (name.endsWith('4') ? 4 : 8);

/** Passes that keys of so many bits take. */
const passCount = (name: SortName, keyBits: number): number => Math.max(1, Math.ceil(keyBits / digitBits(name)));

/** Subgroups that a workgroup of the sort can have on a device. */
function subgroupsOf(device: GPUDevice): number {
  const least = device.adapterInfo?.subgroupMinSize ?? 4;
  return SORT_THREADS / Math.max(4, least);
}

/** Words with a bit for each thread of a subgroup. */
function voteWordsOf(device: GPUDevice): number {
  return Math.ceil((device.adapterInfo?.subgroupMaxSize ?? 128) / 32);
}

/** True if the device has what the variant needs: for votes, room for the counts of all subgroups where a block of keys lies later. */
export function canSort(device: GPUDevice, name: SortName): boolean {
  if (!name.startsWith('subgroup')) return true;
  return device.features.has('subgroups') && 2 ** digitBits(name) * subgroupsOf(device) <= SORT_BLOCK;
}

/** What moves along with a key: its index, or a word of the caller's. */
export type SortValues = 'indices' | 'given';

/** Which of the two buffers of keys, and of given words, holds the result for keys of so many bits: the first (0) or the second (1). */
export const sortedIn = (name: SortName, keyBits: number): 0 | 1 => (passCount(name, keyBits) % 2 === 0 ? 0 : 1);

/**
 * Stable least-significant-digit radix sort of keys of up to 32 bits: for each digit a pass of count, scan, scatter.
 * Counts are reduced and scanned between dispatches, so no workgroup ever waits for another.
 */
export class SortStage {
  readonly name: SortName;
  readonly #moving: SortValues;
  readonly #count: ComputeKernel<typeof sortCount> | ComputeKernel<typeof sortCountSerial>;
  readonly #scan: ComputeKernel<typeof sortScan> | ComputeKernel<typeof sortScanSerial>;
  readonly #scanGroups: number;
  readonly #scatter: ComputeKernel<typeof sortScatter> | ComputeKernel<typeof sortScatterSerial>;
  readonly #passUniforms: readonly GPUBuffer[];

  constructor(device: GPUDevice, name: SortName = 'shared8', moving: SortValues = 'indices') {
    this.name = name;
    this.#moving = moving;
    const isSerial = name === 'serial';
    const bits = digitBits(name);
    this.#count = isSerial ? kernelOf(device, sortCountSerial) : kernelOf(device, withDigits(sortCount, bits));
    this.#scan = isSerial ? kernelOf(device, sortScanSerial) : kernelOf(device, withDigits(sortScan, bits));
    this.#scanGroups = Math.ceil(2 ** bits / (isSerial ? DIGITS_PER_SERIAL_GROUP : DIGITS_PER_GROUP));
    this.#scatter = kernelOf(device, scatterShader(device, name)) as ComputeKernel<typeof sortScatter>;
    this.#passUniforms = perDevice(device, `sort passes ${moving} ${bits}`, () =>
      makePassUniforms(device, moving, bits),
    );
  }

  /** @param keyBits how many of the lowest bits of a key count; the others must be 0 or are ignored. */
  bind({ plan, keys, values, digitCounts, digitTotals }: SortBuffers, keyBits = MAX_KEY_BITS): readonly SortPass[] {
    const passes = passCount(this.name, keyBits);
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

  record(pass: GPUComputePassEncoder, bindings: readonly SortPass[], plan: GPUBuffer): void {
    for (const { count, scan, scatter } of bindings) {
      this.#count.dispatchIndirect(pass, count, plan, planOffsets.sort);
      this.#scan.dispatch(pass, scan, this.#scanGroups);
      this.#scatter.dispatchIndirect(pass, scatter, plan, planOffsets.sort);
    }
  }
}

export type SortBindings = ReturnType<SortStage['bind']>;

function scatterShader(device: GPUDevice, name: SortName): ShaderDescription {
  if (name === 'serial') return sortScatterSerial;
  const bits = digitBits(name);
  if (!name.startsWith('subgroup')) return withDigits(sortScatter, bits);
  const replaced = { SUBGROUPS: [8, subgroupsOf(device)], VOTE_WORDS: [4, voteWordsOf(device)] };
  let sized: ShaderDescription = sortScatterSubgroups;
  for (const [name, [usual, own]] of Object.entries(replaced)) {
    sized = specialise(sized, `${own}`, `const ${name} = ${usual}u`, `const ${name} = ${own}u`);
  }
  const { code, ...rest } = withDigits(sized, bits);
  return { ...rest, code: `enable subgroups;\n${code}` };
}

function withDigits<S extends ShaderDescription>(shader: S, bits: 4 | 8): S {
  if (bits === 8) return shader;
  const narrower = specialise(shader, '4 bits', 'const DIGIT_BITS = 8u', `const DIGIT_BITS = ${bits}u`);
  return specialise(narrower, 'digits', 'const DIGITS = 256u', `const DIGITS = ${2 ** bits}u`);
}

function makePassUniforms(device: GPUDevice, moving: SortValues, bits: number): GPUBuffer[] {
  return Array.from({ length: MAX_KEY_BITS / bits }, (_, index) => {
    const buffer = device.createBuffer({
      label: `gs.sort.pass_${index}`,
      size: 16,
      usage: BUFFER_USAGE.uniform,
      mappedAtCreation: true,
    });
    const makesIndices = index === 0 && moving === 'indices';
    const values = { shift: index * bits, makes_indices: makesIndices ? 1 : 0 };
    writeStruct(layouts.SortPass, values, buffer.getMappedRange());
    buffer.unmap();
    return buffer;
  });
}
