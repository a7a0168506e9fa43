import { constants } from './generated/shaders.js';

/**
 * Allowed total coverage of a frame at full size, in frames: a constant, plus more for larger scenes. Captured scenes
 * need tens to hundreds.
 */
const FREE_FRAMES = 1_000;
const FRAMES_PER_SPLAT = 1 / 500;
/** The resolution is lower than the limit requires by this factor. */
const MARGIN = 1.25;
const NO_LIMIT = 0xffffffff;

/**
 * Limits the pixels that all splats of a frame cover together. `cull` sums their coverage of the image on the GPU, and
 * `project` drops the largest splats of a frame that exceeds the limit. The sum is read back with the counts of the
 * frame; the next frames have fewer pixels, and then show all splats.
 */
export class OverdrawLimit {
  /** Resolution scale of each side of the frame, 0..1. */
  share = 1;

  /** Whether this many splats may cover a frame too often: each covers it at most once. */
  mayExceed(splats: number): boolean {
    return splats > FREE_FRAMES;
  }

  /** `View.max_covered` of the next frame. */
  maxFor(splats: number): number {
    return Math.min(NO_LIMIT, Math.floor((constants.COVERED_UNIT * allowedFor(splats)) / this.share));
  }

  /**
   * Records the coverage of a frame. Fewer pixels make the frame cheaper by the square of the scale, so a sum far above
   * the limit then costs less than one at it.
   * @returns Whether the next frame changes.
   */
  note(covered: number, splats: number): boolean {
    const before = this.share;
    const max = allowedFor(splats) / covered;
    // Hysteresis: at rest the same view never alternates.
    if (max < before || max > MARGIN * MARGIN * before) this.share = Math.min(1, max / MARGIN);
    return this.share !== before;
  }
}

const allowedFor = (splats: number): number => FREE_FRAMES + FRAMES_PER_SPLAT * splats;
