import { GaussianSplatError } from '@gaussian-splat/core';
import type { LoadLimits } from '../budget.js';
import { grouped } from '../bytes.js';

/** Maximum number of steps to find a floor, about a minute. A step visits a voxel or compares a height. */
const MAX_STEPS = 2 ** 33;
/** Number of steps after which the time limit is checked, some milliseconds. */
const STEPS_PER_CHECK = 2 ** 20;

/** Account of the work to find a floor, because the scene determines its amount. */
export class FloorWork {
  #left = MAX_STEPS;
  #nextCheck = MAX_STEPS;
  readonly #maxSeconds: number;
  readonly #start = performance.now();

  constructor({ maxSeconds = Infinity }: Pick<LoadLimits, 'maxSeconds'> = {}) {
    this.#maxSeconds = maxSeconds;
  }

  /**
   * Charges steps.
   * @throws GaussianSplatError `out-of-memory/budget` after {@link MAX_STEPS}, or after `maxSeconds`.
   */
  take(steps: number): void {
    this.#left -= steps;
    if (this.#left >= this.#nextCheck) return;
    if (this.#left < 0) throw tooLarge(`at most ${grouped(MAX_STEPS)} steps of work`, 'more');
    this.#nextCheck = this.#left - STEPS_PER_CHECK;
    if (performance.now() - this.#start > 1000 * this.#maxSeconds)
      throw tooLarge(`at most ${this.#maxSeconds} s`, 'more');
  }
}

/** Returns the error for a scene whose floor would take too much work or memory. */
export function tooLarge(expected: string, found: string): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/budget', {
    where: 'floor of the scene',
    expected,
    found,
    remedy: 'remove the splats around the scene, check its unit, or choose a larger cell with gaussian-splat floor',
  });
}
