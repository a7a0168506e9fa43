import type { Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from '../levels/chunk-detail.js';
import { NONE } from './page-list.js';
import { movePoints } from './slot-words.js';

const { ARRIVAL_STEPS, CHILD_PAGE_BITS, CHILD_PAGE_MASK } = constants;

/** A page that has arrived, in the steps in which pages do. */
export const ARRIVED = ARRIVAL_STEPS;

/**
 * The detail rows of a slot, as on the GPU: what is said of the chunks in it, and how far the page that they are part of and those below it have arrived. What is
 * below a page must never have arrived further than the page itself.
 */
export class PageRows {
  readonly numbers: Float32Array<ArrayBuffer>;
  readonly #words: Uint32Array<ArrayBuffer>;
  #children: Uint32Array = new Uint32Array(0);

  /** @param numbers of the page's slot */
  constructor(numbers: Float32Array<ArrayBuffer>) {
    this.numbers = numbers;
    this.#words = new Uint32Array(numbers.buffer, numbers.byteOffset, numbers.length);
  }

  /**
   * Takes chunks over that nothing is below of yet.
   * @param details as in a page's file
   * @param by world units, added to all positions
   * @param children numbers of the pages below each chunk, or {@link NONE}
   */
  load(details: Float32Array, by: Vector3, children: Uint32Array): void {
    this.clear();
    this.numbers.set(details);
    movePoints(this.numbers, DETAIL_PLACES.sphere, details.length, DETAIL_NUMBERS, by);
    movePoints(this.numbers, DETAIL_PLACES.parentSphere, details.length, DETAIL_NUMBERS, by);
    this.#children = children;
    for (let chunk = 0; chunk < children.length; chunk++) if (children[chunk] !== NONE) this.setBelow(chunk, 0);
  }

  /** Nothing is in the slot that might be drawn. */
  clear(): void {
    this.numbers.fill(0);
    this.#children = new Uint32Array(0);
  }

  /** Sphere and error of a chunk, for what has it above itself. */
  above(chunk: number): { readonly sphere: Float32Array; readonly error: number } {
    const at = DETAIL_NUMBERS * chunk;
    const sphere = this.numbers.subarray(at + DETAIL_PLACES.sphere, at + DETAIL_PLACES.sphere + 4);
    return { sphere, error: this.numbers[at + DETAIL_PLACES.fullError] };
  }

  /** Puts a chunk of another page above the first chunks of this one. */
  setAbove(upper: number, { sphere, error }: ReturnType<PageRows['above']>): void {
    for (let chunk = 0; chunk < upper; chunk++) {
      this.numbers.set(sphere, DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentSphere);
      this.numbers[DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentError] = error;
    }
  }

  /** How far, 0 to {@link ARRIVED}, the page below a chunk has arrived: so far the chunk gives way to it. */
  setBelow(chunk: number, arrived: number): void {
    const at = DETAIL_NUMBERS * chunk;
    this.numbers[at + DETAIL_PLACES.error] = (this.numbers[at + DETAIL_PLACES.fullError] * arrived) / ARRIVED;
  }

  /** How far the page itself has arrived. */
  setArrived(arrived: number): void {
    const children = this.#children;
    for (let chunk = 0; chunk < children.length; chunk++) {
      const child = children[chunk];
      const page = child === NONE ? CHILD_PAGE_MASK : child;
      this.#words[DETAIL_NUMBERS * chunk + DETAIL_PLACES.children] = (page | (arrived << CHILD_PAGE_BITS)) >>> 0;
      // What such a chunk stands for is in this page, too, or is nothing.
      if (child === NONE) this.setBelow(chunk, arrived);
    }
  }
}
