import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from './chunk-detail.js';
import { pageLayout, type DetailManifest } from './manifest.js';
import { NONE, type PageList } from './page-list.js';
import { childrenOf } from './residency.js';

const { ARRIVAL_STEPS, CHILD_PAGE_BITS, CHILD_PAGE_MASK } = constants;

/** A page that has arrived, in the steps in which pages do. */
export const ARRIVED = ARRIVAL_STEPS;

/**
 * The detail rows of a page in its slot, as on the GPU: what the page's file says of its chunks, and how far the page and those below it have arrived. What is
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

  /** Takes a page over that nothing is below of yet. */
  load(list: PageList, manifest: DetailManifest, page: number, words: Uint32Array<ArrayBuffer>): void {
    const layout = pageLayout(manifest, list.chunks[page]);
    this.numbers.fill(0);
    this.numbers.set(new Float32Array(words.buffer, words.byteOffset + 4 * layout.chunks, layout.details));
    this.#children = childrenOf(list, page);
    this.#children.forEach((child, chunk) => child !== NONE && this.setBelow(chunk, 0));
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
    this.#children.forEach((child, chunk) => {
      const page = child === NONE ? CHILD_PAGE_MASK : child;
      this.#words[DETAIL_NUMBERS * chunk + DETAIL_PLACES.children] = (page | (arrived << CHILD_PAGE_BITS)) >>> 0;
      // What such a chunk stands for is in this page, too, or is nothing.
      if (child === NONE) this.setBelow(chunk, arrived);
    });
  }
}
