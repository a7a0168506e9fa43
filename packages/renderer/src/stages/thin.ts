import { constants, thinCount, thinCountSerial, thinWrite, thinWriteSerial } from '../generated/shaders.js';
import { kernelOf, type ComputeKernel } from '../gpu/kernel.js';
import type { Threads } from './plan.js';

/** What {@link ThinStage} works on. */
export interface ThinBuffers {
  /** Uniform: length of the order, a multiple of four. */
  readonly thin: GPUBuffer;
  /** Numbers of splats. */
  readonly order: GPUBuffer;
  /** One bit for each splat. */
  readonly visibleBits: GPUBuffer;
  /** For each block of the order how many splats are visible; `plan` makes these how many come before it. */
  readonly blockOffsets: GPUBuffer;
  /** Receives the numbers of the visible splats, in the order. */
  readonly survivors: GPUBuffer;
}

interface ThinBindings {
  readonly count: GPUBindGroup;
  readonly write: GPUBindGroup;
}

/** Thins an order of all splats to the visible ones. */
export class ThinStage {
  readonly #count: ComputeKernel<typeof thinCount> | ComputeKernel<typeof thinCountSerial>;
  readonly #write: ComputeKernel<typeof thinWrite> | ComputeKernel<typeof thinWriteSerial>;
  readonly #blocksPerGroup: number;

  constructor(device: GPUDevice, threads: Threads = 'parallel') {
    const isSerial = threads === 'serial';
    this.#count = isSerial ? kernelOf(device, thinCountSerial) : kernelOf(device, thinCount);
    this.#write = isSerial ? kernelOf(device, thinWriteSerial) : kernelOf(device, thinWrite);
    this.#blocksPerGroup = isSerial ? constants.BLOCKS_PER_SERIAL_GROUP : 1;
  }

  bind({ thin, order, visibleBits, blockOffsets, survivors }: ThinBuffers): ThinBindings {
    return {
      count: this.#count.bind({ thin, order, visible_bits: visibleBits, block_counts: blockOffsets }),
      write: this.#write.bind({ thin, order, visible_bits: visibleBits, block_offsets: blockOffsets, survivors }),
    };
  }

  recordCount(pass: GPUComputePassEncoder, bindings: ThinBindings, length: number): void {
    this.#count.dispatch(pass, bindings.count, this.#groups(length));
  }

  recordWrite(pass: GPUComputePassEncoder, bindings: ThinBindings, length: number): void {
    this.#write.dispatch(pass, bindings.write, this.#groups(length));
  }

  #groups(length: number): number {
    return Math.ceil(thinBlocks(length) / this.#blocksPerGroup);
  }
}

/** Blocks that an order of so many splats is thinned in. */
export function thinBlocks(length: number): number {
  return Math.ceil(length / constants.THIN_BLOCK);
}
