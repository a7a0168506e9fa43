import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import type { Scratch } from './scratch.js';

/** Counts of one frame. */
export interface FrameStats {
  /** Number of drawn splats: in front of the camera, opaque enough, and covering at least one pixel. */
  readonly visible: number;
  /**
   * Number of visible splats beyond the capacity of the renderer's buffers. They were not drawn; the next frames have
   * enough capacity.
   */
  readonly overflow: number;
  /** Number of pairs of splat and bin that the rasterizer `tiles` drew; 0 with `quads`. */
  readonly pairs: number;
  /**
   * Number of pairs beyond the capacity, of the farthest splats. They were not drawn; the next frames have enough
   * capacity.
   */
  readonly pairOverflow: number;
  /** Number of splats with unusable values on the GPU, in the chunks that may be visible. */
  readonly unusable: number;
  /**
   * Error threshold in pixels that keeps the frame within its `splatBudget`; 0 without a budget, or if all splats fit.
   */
  readonly budgetError: number;
  /** Total coverage of the frame by the visible splats, as a multiple of its pixels. */
  readonly covered: number;
}

/**
 * Reads the counts of the last frame back from the GPU. All counts are 0 before the first frame.
 * @param scratch Buffers of the last frame; undefined before the first.
 * @param pairPlan `Plan` of the pairs; undefined for `quads`.
 */
export async function readFrameStats(
  device: GPUDevice,
  scratch: Pick<Scratch, 'plan' | 'cullStats' | 'chunkShares'> | undefined,
  pairPlan: GPUBuffer | undefined,
): Promise<FrameStats> {
  if (!scratch) return { visible: 0, overflow: 0, pairs: 0, pairOverflow: 0, unusable: 0, budgetError: 0, covered: 0 };
  const { visible, overflow } = layouts.Plan.fields;
  const sources: [GPUBuffer | undefined, number][] = [
    [scratch.plan, visible.offset],
    [scratch.plan, overflow.offset],
    [pairPlan, visible.offset],
    [pairPlan, overflow.offset],
    [scratch.cullStats, 4 * constants.UNUSABLE],
    [scratch.chunkShares, scratch.chunkShares.size - 4],
    [scratch.cullStats, 4 * constants.COVERED],
  ];
  const staging = device.createBuffer({
    label: 'gs.statistics',
    size: 4 * sources.length,
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  const encoder = device.createCommandEncoder();
  sources.forEach(([buffer, offset], i) => buffer && encoder.copyBufferToBuffer(buffer, offset, staging, 4 * i, 4));
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const words = new Uint32Array(staging.getMappedRange().slice(0));
  staging.destroy();
  const [budgetError] = new Float32Array(words.buffer, 4 * 5, 1);
  return {
    visible: words[0],
    overflow: words[1],
    pairs: words[2],
    pairOverflow: words[3],
    unusable: words[4],
    budgetError,
    covered: words[6] / constants.COVERED_UNIT,
  };
}
