/** Duration of a step above which it is a seek, s. Playback then continues forward. */
const SEEK_SECONDS = 0.5;

/** The direction of playback, from the frames that are requested. Frames are fetched ahead in this direction. */
export class PlayDirection {
  readonly #frameCount: number;
  readonly #maxStep: number;
  #last: number | undefined;
  #direction: 1 | -1 = 1;

  constructor(frameCount: number, framesPerSecond: number) {
    this.#frameCount = frameCount;
    this.#maxStep = Math.max(1, SEEK_SECONDS * framesPerSecond);
  }

  /** The direction after the last request. */
  get direction(): 1 | -1 {
    return this.#direction;
  }

  /**
   * Returns the direction after the request of a frame: 1 for forward, -1 for backward. `loops`: whether the first frame
   * follows the last.
   */
  at(frame: number, loops: boolean): 1 | -1 {
    let step = frame - (this.#last ?? frame);
    if (loops && Math.abs(step) > this.#frameCount / 2) step -= Math.sign(step) * this.#frameCount;
    if (step !== 0) this.#direction = step < 0 && -step <= this.#maxStep ? -1 : 1;
    this.#last = frame;
    return this.#direction;
  }
}

/** Returns `count` indices from `first` on in a direction, up to the last one of `length`, or around it. */
export function indicesFrom(first: number, count: number, direction: 1 | -1, length: number, loops: boolean): number[] {
  const all = Array.from({ length: count }, (_, k) => first + direction * k);
  return loops
    ? all.map((each) => ((each % length) + length) % length)
    : all.filter((each) => each >= 0 && each < length);
}
