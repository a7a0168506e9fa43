import { constants, layouts } from './generated/shaders.js';
import { readBack } from './gpu/read-back.js';
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
  const { cullStats, chunkShares } = scratch;
  // `overflow` follows `visible`, which a test of the layouts checks.
  const counts = { byteOffset: layouts.Plan.fields.visible.offset, byteLength: 8 };
  const parts = [
    { buffer: scratch.plan, ...counts },
    { buffer: cullStats, byteOffset: 4 * constants.UNUSABLE, byteLength: 4 },
    { buffer: cullStats, byteOffset: 4 * constants.COVERED, byteLength: 4 },
    { buffer: chunkShares, byteOffset: chunkShares.size - 4, byteLength: 4 },
    ...(pairPlan ? [{ buffer: pairPlan, ...counts }] : []),
  ];
  const read = (await readBack(device, parts)).map((bytes) => new Uint32Array(bytes));
  const [[visible, overflow], [unusable], [covered], share, [pairs, pairOverflow] = [0, 0]] = read;
  const [budgetError] = new Float32Array(share.buffer);
  return { visible, overflow, pairs, pairOverflow, unusable, budgetError, covered: covered / constants.COVERED_UNIT };
}
