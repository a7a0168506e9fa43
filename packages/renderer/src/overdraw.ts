import { constants } from './generated/shaders.js';

/**
 * Constant part of the allowed coverage, as a multiple of a frame at full size. Captured scenes have a coverage of tens
 * to hundreds.
 */
const FREE_FRAMES = 1_000;
/** Allowed coverage for each splat of a scene, as a multiple of a frame, in addition to the constant part. */
const FRAMES_PER_SPLAT = 1 / 500;
/** Safety factor of the resolution: pixels are reduced by this factor more than the limit requires. */
const MARGIN = 1.25;
const NO_LIMIT = 0xffffffff;

/**
 * Limits the number of pixels that all splats of a frame cover together. `cull` sums their coverage of the image on the
 * GPU, and `project` drops the largest splats of a frame that exceeds the limit. The sum is read back with the counts
 * of the frame. The next frames then have fewer pixels, and show all splats.
 */
export class OverdrawLimit {
  /** Resolution scale of each side of the frame, 0..1. */
  share = 1;

  /**
   * Whether the coverage of a frame with this many splats can change {@link share}. Each splat covers the frame at most
   * once.
   */
  mayExceed(splats: number): boolean {
    return this.share < 1 || splats > FREE_FRAMES;
  }

  /** Returns `View.max_covered` of the next frame, for a number of splats. */
  maxFor(splats: number): number {
    return Math.min(NO_LIMIT, Math.floor((constants.COVERED_UNIT * allowedFor(splats)) / this.share));
  }

  /**
   * Records the coverage of a frame, and updates {@link share}. The scale is the allowed coverage divided by the
   * measured one, but the cost of a frame falls with the square of the scale. A frame far above the limit is therefore
   * drawn at less cost than one at the limit.
   * @param covered Coverage as a multiple of the frame.
   * @param splats Number of splats of the scenes.
   * @returns Whether the resolution of the next frame changes.
   */
  note(covered: number, splats: number): boolean {
    const before = this.share;
    const max = allowedFor(splats) / covered;
    // Hysteresis prevents the resolution from alternating while the view is at rest.
    if (max < before || max > MARGIN * MARGIN * before) this.share = Math.min(1, max / MARGIN);
    return this.share !== before;
  }
}

const allowedFor = (splats: number): number => FREE_FRAMES + FRAMES_PER_SPLAT * splats;
