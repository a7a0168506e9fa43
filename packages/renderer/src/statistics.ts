import { constants, layouts } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';

/** Counts of one frame. */
export interface FrameStatistics {
  /** Splats drawn: in front of the camera, opaque enough, and over at least one pixel. */
  readonly visible: number;
  /** Visible splats that found no room in the renderer's buffers and were left out; the next frames have room. */
  readonly overflow: number;
  /** Pairs of splat and bin that tiles painted; 0 with quads. */
  readonly pairs: number;
  /** Pairs, of the farthest splats, that found no room and were left out; the next frames have room. */
  readonly pairOverflow: number;
  /** Splats on the GPU that were refused because a value was not usable, in the chunks that may be visible. */
  readonly unusable: number;
  /** Pixels by which what is drawn may be displaced so that the frame keeps its `splatBudget`; 0 without one, or with room for all. */
  readonly budgetError: number;
  /** How often the visible splats cover the frame: the sum of the shares of its pixels that they take. */
  readonly covered: number;
}

/** The buffers that hold the counts. */
export interface Counters {
  /** `Plan` of the splats and, with tiles, of the pairs. */
  readonly plan: GPUBuffer;
  readonly pairPlan?: GPUBuffer;
  /** See shaders/shared/gathered.wgsl. */
  readonly gathered: GPUBuffer;
  /** Its last word is what a budget asks for: see `Scratch.chunkShares`. */
  readonly chunkShares: GPUBuffer;
}

/** Reads the counts back. */
export async function readStatistics(device: GPUDevice, counters: Counters): Promise<FrameStatistics> {
  const { visible, overflow } = layouts.Plan.fields;
  const sources: [GPUBuffer | undefined, number][] = [
    [counters.plan, visible.offset],
    [counters.plan, overflow.offset],
    [counters.pairPlan, visible.offset],
    [counters.pairPlan, overflow.offset],
    [counters.gathered, 4 * constants.UNUSABLE],
    [counters.chunkShares, counters.chunkShares.size - 4],
    [counters.gathered, 4 * constants.COVERED],
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
