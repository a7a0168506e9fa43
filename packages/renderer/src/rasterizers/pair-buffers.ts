/** Buffers of the rasterizer `tiles` for pairs of splat and bin. */
import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { scanBytes } from '../stages/stage.js';
import type { RasterizerInputs, Room } from './rasterizer.js';

const { PREFIX_THREADS, PROJECT_GROUP, SORT_BLOCK, DIGITS } = constants;
/** A slot, or a bin. */
const WORD_BYTES = 4;

/** Buffers whose size follows the scene. */
export interface PairBuffers {
  /** Shares memory with the second of {@link bins}, which is first written when pairs are sorted. */
  readonly rects: GPUBuffer;
  readonly groupPairs: GPUBuffer;
  readonly plan: GPUBuffer;
  /** The second is a ping-pong buffer of {@link RasterizerInputs}. */
  readonly bins: readonly [GPUBuffer, GPUBuffer];
  /** The first is the other ping-pong buffer. */
  readonly pairs: readonly [GPUBuffer, GPUBuffer];
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
}

/** `bin_index` writes its bits in whole groups. */
const wholeGroups = (pairs: number): number => PROJECT_GROUP * Math.ceil(pairs / PROJECT_GROUP);

/** Bytes of either ping-pong buffer. */
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

/** Maximum number of pairs that the device's buffers can hold: whole groups. */
export function maxPairs(device: GPUDevice): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  const bytes = Math.min(maxBufferSize, maxStorageBufferBindingSize);
  return PROJECT_GROUP * Math.floor(bytes / (PROJECT_GROUP * WORD_BYTES));
}
