import { PAGE_CHUNKS } from './manifest.js';
import { NONE, type PageList } from './page-list.js';

/** How much more pixels a page must save than one that has to leave for it, both being wished for. */
const WORTH = 1.5;

/**
 * Which pages are in which slots, and which should come and go. The chunk above a page is there as long as the page is: pages come from the coarse to the fine
 * and leave from the fine to the coarse, so that what is there always covers the scene.
 */
export class Residency {
  /** [S] page in each slot, or {@link NONE}. */
  readonly pageIn: Uint32Array;
  /** [P] slot of each page, or {@link NONE}. */
  readonly slotOf: Uint32Array;
  readonly #list: PageList;
  /** [P] pixels that doing without a page would cost, when last looked, and at which look it was last wished for. */
  readonly #wish: Float32Array;
  readonly #wishedAt: Uint32Array;
  /** [P] pages below a page that are there or on their way. */
  readonly #below: Uint16Array;
  readonly #coming = new Set<number>();
  #look = 0;
  #residents = 0;

  constructor(list: PageList, slots: number) {
    this.#list = list;
    this.pageIn = new Uint32Array(slots).fill(NONE);
    this.slotOf = new Uint32Array(list.count).fill(NONE);
    this.#wish = new Float32Array(list.count);
    this.#wishedAt = new Uint32Array(list.count);
    this.#below = new Uint16Array(list.count);
  }

  isResident(page: number): boolean {
    return this.slotOf[page] !== NONE;
  }

  /** Pages that are there. */
  get residents(): number {
    return this.#residents;
  }

  /** Takes note of a look: for each page the pixels that doing without it would cost, 0 for those that nobody wishes for. */
  note(wishes: Float32Array): void {
    this.#look++;
    for (let page = 0; page < this.#list.count; page++) {
      this.#wish[page] = wishes[page];
      if (wishes[page] > 0) this.#wishedAt[page] = this.#look;
    }
  }

  /** Wished pages that are neither there nor on their way, though what is above them is; the most needed first. */
  get missing(): number[] {
    const { parent } = this.#list;
    const pages: number[] = [];
    for (let page = 0; page < this.#list.count; page++) {
      const isFine = parent[page] === NONE || this.isResident(parent[page]);
      if (this.#wish[page] > 0 && isFine && this.lacks(page)) pages.push(page);
    }
    return pages.sort((a, b) => this.#wish[b] - this.#wish[a]);
  }

  /** True for a page that is neither there nor on its way. */
  lacks(page: number): boolean {
    return !this.isResident(page) && !this.#coming.has(page);
  }

  /** Starts bringing a page if there is room for it, or something to leave that is needed less. */
  begin(page: number): boolean {
    if (this.residents + this.#coming.size >= this.pageIn.length && this.#leaver(page) === NONE) return false;
    this.#coming.add(page);
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#below[parent]++;
    return true;
  }

  /** A page that was on its way does not come. */
  giveUp(page: number): void {
    if (!this.#coming.delete(page)) return;
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#below[parent]--;
  }

  /** A page has come. @returns its slot and the page that left it, {@link NONE} for none; undefined if there is no room any more. */
  settle(page: number): { slot: number; left: number } | undefined {
    let slot = this.pageIn.indexOf(NONE);
    let left = NONE;
    if (slot >= 0) this.#residents++;
    else {
      left = this.#leaver(page);
      if (left === NONE) {
        this.giveUp(page);
        return undefined;
      }
      slot = this.slotOf[left];
      this.slotOf[left] = NONE;
      this.#below[this.#list.parent[left]]--;
    }
    this.#coming.delete(page);
    this.pageIn[slot] = page;
    this.slotOf[page] = slot;
    return { slot, left };
  }

  /** The page that can best be spared for another: nothing below it, not wished for the longest; or else wished for much less. */
  #leaver(page: number): number {
    let best = NONE;
    let [bestAge, bestWish] = [-1, this.#wish[page] / WORTH];
    const above = this.#list.parent[page];
    for (const candidate of this.pageIn) {
      if (
        candidate === NONE ||
        candidate === above ||
        this.#below[candidate] > 0 ||
        this.#list.parent[candidate] === NONE
      )
        continue;
      const age = this.#look - this.#wishedAt[candidate];
      const isBetter = age > bestAge || (age === bestAge && this.#wish[candidate] < bestWish);
      if (!isBetter || (age === 0 && this.#wish[candidate] >= bestWish)) continue;
      [best, bestAge, bestWish] = [candidate, age, this.#wish[candidate]];
    }
    return best;
  }
}

/** Numbers of the pages below the chunks of a page, {@link NONE} where there is none. */
export const childrenOf = (list: PageList, page: number): Uint32Array =>
  list.children.subarray(PAGE_CHUNKS * page, PAGE_CHUNKS * page + list.chunks[page]);
