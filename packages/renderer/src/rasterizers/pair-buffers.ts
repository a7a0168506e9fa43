/** What the rasterizer `tiles` keeps of pairs of splat and bin. */
import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { scanBytes } from '../stages/scan.js';
import type { RasterizerInputs } from './rasterizer.js';

const { PREFIX_THREADS, PROJECT_GROUP, SORT_BLOCK, DIGITS } = constants;
/** A slot, and a mask of tiles. */
const PAIR_BYTES = 8;

/** Buffers whose size follows the scene. */
export interface PairBuffers {
  /** Until pairs are sorted, the second of {@link bins}: it is first written then. */
  readonly rects: GPUBuffer;
  readonly groupPairs: GPUBuffer;
  readonly plan: GPUBuffer;
  readonly bins: readonly [GPUBuffer, GPUBuffer];
  readonly pairs: readonly [GPUBuffer, GPUBuffer];
  readonly digitCounts: GPUBuffer;
  readonly digitTotals: GPUBuffer;
}

export function pairBuffers(
  memory: GpuMemory,
  { capacity, pairCapacity }: Pick<RasterizerInputs, 'capacity' | 'pairCapacity'>,
): PairBuffers {
  const { storage, copyDestination, copySource, indirect } = BUFFER_USAGE;
  const buffer = (name: string, bytes: number): GPUBuffer =>
    memory.buffer(`gs.bin.${name}`, bytes, storage | copySource | copyDestination | indirect);
  // `bin_index` writes its bits in whole groups.
  const pairs = PROJECT_GROUP * Math.ceil(pairCapacity / PROJECT_GROUP);
  const bins: [GPUBuffer, GPUBuffer] = [buffer('bins_a', 4 * pairs), buffer('bins_b', 4 * Math.max(pairs, capacity))];
  return {
    rects: bins[1],
    groupPairs: buffer('group_pairs', scanBytes(Math.ceil(capacity / PREFIX_THREADS))),
    plan: buffer('plan', layouts.Plan.size + layouts.PagePlan.size),
    bins,
    pairs: [buffer('pairs_a', PAIR_BYTES * pairs), buffer('pairs_b', PAIR_BYTES * pairs)],
    digitCounts: buffer('digit_counts', 4 * DIGITS * Math.ceil(pairCapacity / SORT_BLOCK)),
    digitTotals: buffer('digit_totals', 4 * DIGITS),
  };
}

/** Most pairs for which the device's buffers can have room. */
export function maxPairs(device: GPUDevice): number {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  return Math.floor(Math.min(maxBufferSize, maxStorageBufferBindingSize) / PAIR_BYTES);
}
