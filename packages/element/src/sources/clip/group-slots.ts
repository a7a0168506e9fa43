import type { ClipIndex } from '@gaussian-splat/formats';
import { ANIMATION_SLOTS, STILL_SLOT, type AnimatedGaussians } from '@gaussian-splat/renderer';
import { partsIn, STILL, type GroupCache } from './group-cache.js';

/** Maximum bytes per frame for uploading parts that are not needed at once. */
const BYTES_PER_FRAME = 1 << 20;

/** Uploads groups of frames to slots of GPU memory, and shows their frames. */
export class GroupSlots {
  readonly #gaussians: AnimatedGaussians;
  readonly #index: ClipIndex;
  /** Index of the group in each slot; -1 for none. */
  readonly #groups = new Array<number>(ANIMATION_SLOTS).fill(-1);
  #shownFrame = -1;
  #shownSlot = 0;
  /** Number of parts that the shown frame contains. */
  #shownParts = 0;

  constructor(gaussians: AnimatedGaussians, index: ClipIndex) {
    this.#gaussians = gaussians;
    this.#index = index;
  }

  /** Index in the clip of the shown frame; -1 before the first. */
  get shownFrame(): number {
    return this.#shownFrame;
  }

  /**
   * Shows a frame of a group with the parts that are loaded, and uploads more parts of this group and the next.
   * @param frame Index of the frame in the clip.
   * @param group Index of the group of the frame.
   * @returns Whether parts were uploaded, so that another frame is needed.
   */
  show(frame: number, group: number, cache: GroupCache): boolean {
    const gaussians = this.#gaussians;
    const coarse = cache.canShow(group) ? cache.get(group, 0) : undefined;
    let slot = this.#groups.indexOf(group);
    if (slot < 0 && coarse) slot = this.#take(group, this.#shownSlot);
    if (slot >= 0 && coarse && !gaussians.isWritten(slot, 0)) gaussians.write(slot, 0, coarse);
    const still = cache.get(STILL, 0);
    if (still && !gaussians.isWritten(STILL_SLOT, 0)) gaussians.write(STILL_SLOT, 0, still);
    let left = BYTES_PER_FRAME - this.#upload(STILL_SLOT, STILL, cache, BYTES_PER_FRAME);
    if (slot >= 0 && left > 0) left -= this.#upload(slot, group, cache, left);
    if (slot >= 0 && gaussians.isWritten(slot, 0)) this.#draw(slot, frame, group);
    const next = (group + 1) % this.#index.groups.length;
    if (left > 0 && slot >= 0 && next !== group && cache.get(next, 0)) {
      const other = this.#groups.indexOf(next);
      left -= this.#upload(other < 0 ? this.#take(next, slot) : other, next, cache, left);
    }
    return left < BYTES_PER_FRAME;
  }

  /** Clears a slot other than `kept`, and assigns it to a group. Returns the index of the slot. */
  #take(group: number, kept: number): number {
    const slot = (kept + 1) % ANIMATION_SLOTS;
    this.#gaussians.clear(slot);
    this.#groups[slot] = group;
    return slot;
  }

  #upload(slot: number, group: number, cache: GroupCache, max: number): number {
    let written = 0;
    partsIn(this.#index, group).forEach((_, part) => {
      const content = cache.get(group, part);
      if (content && written < max && !this.#gaussians.isWritten(slot, part))
        written += this.#gaussians.write(slot, part, content, max - written);
    });
    return written;
  }

  #draw(slot: number, frame: number, group: number): void {
    const { first, parts } = this.#index.groups[group];
    const { still } = this.#index;
    const there =
      parts.filter((_, part) => this.#gaussians.isWritten(slot, part)).length +
      still.filter((_, part) => this.#gaussians.isWritten(STILL_SLOT, part)).length;
    if (frame === this.#shownFrame && there === this.#shownParts) return;
    this.#gaussians.show(slot, frame - first, there === parts.length + still.length);
    this.#shownFrame = frame;
    this.#shownSlot = slot;
    this.#shownParts = there;
  }
}
