import type { Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from '../levels/chunk-detail.js';
import { NONE } from './page-list.js';
import { movePoints } from './slot-words.js';

const { ARRIVAL_STEPS, CHILD_PAGE_BITS, CHILD_PAGE_MASK } = constants;

/** Progress of a page that has completely faded in. */
export const ARRIVED = ARRIVAL_STEPS;

/**
 * The LOD rows of a slot, as on the GPU: the errors of its chunks, and the fade-in of their page and its children. A
 * child must never have faded in further than its parent.
 */
export class PageRows {
  readonly numbers: Float32Array<ArrayBuffer>;
  readonly #words: Uint32Array<ArrayBuffer>;
  #children: Uint32Array = new Uint32Array(0);

  /** @param numbers Rows of the slot. */
  constructor(numbers: Float32Array<ArrayBuffer>) {
    this.numbers = numbers;
    this.#words = new Uint32Array(numbers.buffer, numbers.byteOffset, numbers.length);
  }

  /**
   * Sets the rows of chunks without resident children.
   * @param details In the layout of a page's file.
   * @param by World units, added to all positions.
   * @param children Indices of the child pages of each chunk, or {@link NONE}.
   */
  load(details: Float32Array, by: Vector3, children: Uint32Array): void {
    this.clear();
    this.numbers.set(details);
    movePoints(this.numbers, DETAIL_PLACES.sphere, details.length, DETAIL_NUMBERS, by);
    movePoints(this.numbers, DETAIL_PLACES.parentSphere, details.length, DETAIL_NUMBERS, by);
    this.#children = children;
    for (let chunk = 0; chunk < children.length; chunk++) if (children[chunk] !== NONE) this.setBelow(chunk, 0);
  }

  /** Empties the slot, so that nothing in it is drawn. */
  clear(): void {
    this.numbers.fill(0);
    this.#children = new Uint32Array(0);
  }

  /** Sphere and error of a chunk, for its children. */
  above(chunk: number): { readonly sphere: Float32Array; readonly error: number } {
    const at = DETAIL_NUMBERS * chunk;
    const sphere = this.numbers.subarray(at + DETAIL_PLACES.sphere, at + DETAIL_PLACES.sphere + 4);
    return { sphere, error: this.numbers[at + DETAIL_PLACES.fullError] };
  }

  /** Sets a chunk of another page as the parent of the first chunks of this one. */
  setAbove(upper: number, { sphere, error }: ReturnType<PageRows['above']>): void {
    for (let chunk = 0; chunk < upper; chunk++) {
      this.numbers.set(sphere, DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentSphere);
      this.numbers[DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentError] = error;
    }
  }

  /** Sets the fade-in, 0 to {@link ARRIVED}, of the child page of a chunk, which replaces the chunk to that degree. */
  setBelow(chunk: number, arrived: number): void {
    const at = DETAIL_NUMBERS * chunk;
    this.numbers[at + DETAIL_PLACES.error] = (this.numbers[at + DETAIL_PLACES.fullError] * arrived) / ARRIVED;
  }

  /** Sets the fade-in of the page itself. */
  setArrived(arrived: number): void {
    const children = this.#children;
    for (let chunk = 0; chunk < children.length; chunk++) {
      const child = children[chunk];
      const page = child === NONE ? CHILD_PAGE_MASK : child;
      this.#words[DETAIL_NUMBERS * chunk + DETAIL_PLACES.children] = (page | (arrived << CHILD_PAGE_BITS)) >>> 0;
      // The children of such a chunk are in this page, too, or there are none.
      if (child === NONE) this.setBelow(chunk, arrived);
    }
  }
}
