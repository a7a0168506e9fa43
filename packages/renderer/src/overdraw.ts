import { constants } from './generated/shaders.js';

/** Times that splats may cover a frame at full size: some, and more for larger scenes. Captured scenes have some tens to some hundreds. */
const FREE_FRAMES = 1_000;
const FRAMES_PER_SPLAT = 1 / 500;
/** Frames are drawn with so many times fewer pixels a side than they might be. */
const MARGIN = 1.25;
const NO_LIMIT = 0xffffffff;

/**
 * Bounds the pixels that all splats of a frame cover together. `cull` sums up their shares of the image on the GPU, and `project` leaves out the largest of a frame that
 * exceeds the limit. The sum comes back with the counts of the frame; the frames that follow have fewer pixels, and then show all splats.
 */
export class OverdrawLimit {
  /** Share of the pixels of each side that frames are drawn with, 0..1. */
  share = 1;

  /** True if that many splats may cover a frame too often: each covers it once at most. */
  mayExceed(splats: number): boolean {
    return splats > FREE_FRAMES;
  }

  /** `View.most_covered` of the next frame. */
  mostFor(splats: number): number {
    return Math.min(NO_LIMIT, Math.floor((constants.COVERED_UNIT * allowedFor(splats)) / this.share));
  }

  /**
   * Takes note of how often the splats cover a frame. Fewer pixels make the frame cheaper by the square of the share, so that a sum far beyond the limit costs less
   * than one at it.
   * @returns whether the next frame differs
   */
  note(covered: number, splats: number): boolean {
    const before = this.share;
    const most = allowedFor(splats) / covered;
    // There is a margin on both sides: at rest the same view never goes back and forth.
    if (most < before || most > MARGIN * MARGIN * before) this.share = Math.min(1, most / MARGIN);
    return this.share !== before;
  }
}

const allowedFor = (splats: number): number => FREE_FRAMES + FRAMES_PER_SPLAT * splats;
