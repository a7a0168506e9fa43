/** Buffers of the rasterizer `tiles` for pairs of splat and bin. */
import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { scanBytes } from '../stages/stage.js';
import type { RasterizerInputs, Room } from './rasterizer.js';

const { PREFIX_THREADS, PROJECT_GROUP, SORT_BLOCK, DIGITS } = constants;
/** Bytes of one array element, a u32: the index of a slot or of a bin. */
const WORD_BYTES = 4;

/** Buffers whose size depends on the capacity in splats and pairs. */
export interface PairBuffers {
  /**
   * Rectangle of bins of each splat. Shares memory with the second of {@link bins}, which is first written when pairs
   * are sorted.
   */
  readonly rects: GPUBuffer;
  readonly groupPairs: GPUBuffer;
  readonly plan: GPUBuffer;
  /** Bin of each pair. The second buffer is a ping-pong buffer of {@link RasterizerInputs}. */
  readonly bins: readonly [GPUBuffer, GPUBuffer];
  /** Slot of each pair. The first buffer is the other ping-pong buffer. */
  readonly pairs: readonly [GPUBuffer, GPUBuffer];
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
}

/** Rounds a number of pairs up to whole groups, because `bin_index` writes the bits of whole groups. */
const wholeGroups = (pairs: number): number => PROJECT_GROUP * Math.ceil(pairs / PROJECT_GROUP);

/** Returns the size of each of the two ping-pong buffers in bytes. */
export const releasableBytesOf = ({ capacity, pairCapacity }: Room): number =>
  WORD_BYTES * Math.max(wholeGroups(pairCapacity), capacity);

export function pairBuffers(
  memory: GpuMemory,
  { capacity, pairCapacity, pingPong }: Pick<RasterizerInputs, 'capacity' | 'pairCapacity' | 'pingPong'>,
): PairBuffers {
  const { storage, copyDestination, copySource } = BUFFER_USAGE;
  const buffer = (name: string, bytes: number): GPUBuffer =>
    memory.buffer(`gs.bin.${name}`, bytes, storage | copySource | copyDestination);
  const pairs = wholeGroups(pairCapacity);
  return {
    rects: pingPong[0],
    groupPairs: buffer('group_pairs', scanBytes(Math.ceil(capacity / PREFIX_THREADS))),
    plan: buffer('plan', layouts.Plan.size + layouts.PagePlan.size),
    bins: [buffer('bins', WORD_BYTES * pairs), pingPong[0]],
    pairs: [pingPong[1], buffer('pairs', WORD_BYTES * pairs)],
    digitCounts: buffer('digit_counts', 4 * DIGITS * Math.ceil(pairCapacity / SORT_BLOCK)),
    digitTotals: buffer('digit_totals', 4 * DIGITS),
  };
}

/** Returns the maximum number of pairs that a buffer of the device can hold, in whole groups. */
export function maxPairs(device: GPUDevice): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  const bytes = Math.min(maxBufferSize, maxStorageBufferBindingSize);
  return PROJECT_GROUP * Math.floor(bytes / (PROJECT_GROUP * WORD_BYTES));
}
