/** Frames without a change after which a scene that changes now and then counts as still. */
const STILL_FRAMES = 8;

/**
 * Whether the content of the scenes stands still. An order of all splats pays only where many frames use it: scenes that are being
 * written frame by frame have their visible splats sorted instead.
 */
export class ContentWatch {
  #version: number | undefined;
  #stillFrames = 0;

  /** Notes a frame that is drawn with a version of the content; 0 is content that never changes. */
  isStill(version: number): boolean {
    this.#stillFrames = version === this.#version ? this.#stillFrames + 1 : 0;
    this.#version = version;
    return version === 0 || this.#stillFrames >= STILL_FRAMES;
  }
}
