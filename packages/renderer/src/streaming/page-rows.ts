import type { Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from '../levels/chunk-detail.js';
import { NONE } from './page-list.js';
import { movePoints } from './slot-words.js';

const { ARRIVAL_STEPS, CHILD_PAGE_BITS, CHILD_PAGE_MASK } = constants;

/** Progress of a page whose fade-in is complete. */
export const ARRIVED = ARRIVAL_STEPS;

/**
 * The LOD rows of a slot, as on the GPU: the errors of its chunks, and the fade-in of their page and of its children.
 * The fade of a child must never be ahead of the fade of its parent.
 */
export class PageRows {
  readonly numbers: Float32Array<ArrayBuffer>;
  readonly #words: Uint32Array<ArrayBuffer>;
  #children: Uint32Array = new Uint32Array(0);

  /** @param numbers Rows of the slot, which this object changes in place. */
  constructor(numbers: Float32Array<ArrayBuffer>) {
    this.numbers = numbers;
    this.#words = new Uint32Array(numbers.buffer, numbers.byteOffset, numbers.length);
  }

  /**
   * Replaces all rows by those of a page whose children are not resident.
   * @param details Rows in the layout of a page's file.
   * @param by Translation in world units, added to all positions.
   * @param children Index of the child page of each chunk, or {@link NONE}.
   */
  load(details: Float32Array, by: Vector3, children: Uint32Array): void {
    this.clear();
    this.numbers.set(details);
    movePoints(this.numbers, DETAIL_PLACES.sphere, details.length, DETAIL_NUMBERS, by);
    movePoints(this.numbers, DETAIL_PLACES.parentSphere, details.length, DETAIL_NUMBERS, by);
    this.#children = children;
    for (let chunk = 0; chunk < children.length; chunk++) if (children[chunk] !== NONE) this.setBelow(chunk, 0);
  }

  /** Clears all rows of the slot, so that nothing in it is drawn. */
  clear(): void {
    this.numbers.fill(0);
    this.#children = new Uint32Array(0);
  }

  /** Returns the sphere and the error of a chunk, in world units, for the rows of its children. */
  above(chunk: number): { readonly sphere: Float32Array; readonly error: number } {
    const at = DETAIL_NUMBERS * chunk;
    const sphere = this.numbers.subarray(at + DETAIL_PLACES.sphere, at + DETAIL_PLACES.sphere + 4);
    return { sphere, error: this.numbers[at + DETAIL_PLACES.fullError] };
  }

  /** Sets a chunk of another page as the parent of the first `upper` chunks of this slot. */
  setAbove(upper: number, { sphere, error }: ReturnType<PageRows['above']>): void {
    for (let chunk = 0; chunk < upper; chunk++) {
      this.numbers.set(sphere, DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentSphere);
      this.numbers[DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentError] = error;
    }
  }

  /**
   * Sets the fade-in of the child page of a chunk, 0 to {@link ARRIVED}. The child page replaces the chunk by this
   * fraction.
   */
  setBelow(chunk: number, arrived: number): void {
    const at = DETAIL_NUMBERS * chunk;
    this.numbers[at + DETAIL_PLACES.error] = (this.numbers[at + DETAIL_PLACES.fullError] * arrived) / ARRIVED;
  }

  /** Sets the fade-in of the page in this slot, 0 to {@link ARRIVED}. */
  setArrived(arrived: number): void {
    const children = this.#children;
    for (let chunk = 0; chunk < children.length; chunk++) {
      const child = children[chunk];
      const page = child === NONE ? CHILD_PAGE_MASK : child;
      this.#words[DETAIL_NUMBERS * chunk + DETAIL_PLACES.children] = (page | (arrived << CHILD_PAGE_BITS)) >>> 0;
      // Without a child page, the children of a chunk are in this page and fade in with it, or do not exist.
      if (child === NONE) this.setBelow(chunk, arrived);
    }
  }
}
