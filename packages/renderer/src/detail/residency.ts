import { PAGE_CHUNKS } from './manifest.js';
import { PageHeap } from './page-heap.js';
import { NONE, type PageList } from './page-list.js';

/** How much more pixels a page must save than one that has to leave for it, both being wished for. */
const WORTH = 1.5;
/** Looks in a row that must not wish for a page on its way before it is given up: views that look in turn wish for different pages. */
const PATIENCE = 2;

/**
 * Which pages are in which slots, and which should come and go. The chunk above a page is there as long as the page is: pages come from the coarse to the fine
 * and leave from the fine to the coarse, so that what is there always covers the scene.
 *
 * A look costs time linear in the pages, a page that comes or goes the logarithm of it.
 */
export class Residency {
  /** [S] page in each slot, or {@link NONE}. Slots are filled in turn and never become empty. */
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
  readonly #missing: PageHeap;
  /** Pages that may leave, those that can best be spared first. */
  readonly #leavers: PageHeap;
  /** [P] 1 for those that are among the leavers or set aside. */
  readonly #isListed: Uint8Array;
  /** Pages that will leave for those on their way that find no empty slot, in the order in which they will; drawn until then. */
  #setAside: number[] = [];
  #look = 0;
  #residents = 0;

  constructor(list: PageList, slots: number) {
    this.#list = list;
    this.pageIn = new Uint32Array(slots).fill(NONE);
    this.slotOf = new Uint32Array(list.count).fill(NONE);
    this.#wish = new Float32Array(list.count);
    this.#wishedAt = new Uint32Array(list.count);
    this.#below = new Uint16Array(list.count);
    this.#isListed = new Uint8Array(list.count);
    this.#missing = new PageHeap(list.count);
    this.#leavers = new PageHeap(slots);
  }

  isResident(page: number): boolean {
    return this.slotOf[page] !== NONE;
  }

  /** Pages that are there. */
  get residents(): number {
    return this.#residents;
  }

  /** Pixels that doing without a page would cost, as of the last look; 0 if that does not wish for it. */
  need(page: number): number {
    return this.#wish[page];
  }

  /** True for a page that the last looks have not wished for. */
  isForgotten(page: number): boolean {
    return this.#look - this.#wishedAt[page] >= PATIENCE;
  }

  /** Takes note of a look: for each page the pixels that doing without it would cost, 0 for those that nobody wishes for. */
  note(wishes: Float32Array): void {
    this.#look++;
    for (let page = 0; page < this.#list.count; page++) {
      this.#wish[page] = wishes[page];
      if (wishes[page] > 0) this.#wishedAt[page] = this.#look;
    }
    this.#listMissing();
    this.#listLeavers();
  }

  /**
   * Takes the most needed page from those that the last look wishes for and that are neither there nor on their way, though what is above them is.
   * @returns {@link NONE} if there is none
   */
  nextMissing(): number {
    for (let page = this.#missing.pop(); page !== NONE; page = this.#missing.pop()) {
      if (this.#isMissing(page)) return page;
    }
    return NONE;
  }

  /** Starts bringing a page if there is room for it, or something to leave that is needed less; if not, nothing is missing until the next look. */
  begin(page: number): boolean {
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#hold(parent);
    if (!this.#makeRoom(page)) {
      if (parent !== NONE) this.#release(parent);
      // What is needed less finds no room either.
      this.#missing.clear();
      return false;
    }
    this.#coming.add(page);
    return true;
  }

  /** A page that was on its way does not come. */
  giveUp(page: number): void {
    if (!this.#coming.delete(page)) return;
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#release(parent);
    if (this.#setAside.length > this.#lackingSlots) this.#return(this.#setAside.pop()!);
  }

  /** A page has come. @returns its slot and the page that left it, {@link NONE} for none; undefined if there is no room any more. */
  settle(page: number): { slot: number; left: number } | undefined {
    const isFull = this.#residents === this.pageIn.length;
    const left = isFull ? this.#leaverFor(page) : NONE;
    if (isFull && left === NONE) {
      this.giveUp(page);
      return undefined;
    }
    const slot = isFull ? this.slotOf[left] : this.#residents++;
    this.#coming.delete(page);
    this.pageIn[slot] = page;
    this.slotOf[page] = slot;
    if (left !== NONE) {
      this.slotOf[left] = NONE;
      this.#release(this.#list.parent[left]);
    }
    this.#offer(page);
    return { slot, left };
  }

  /** Pages on their way that will find no empty slot. */
  get #lackingSlots(): number {
    return Math.max(0, this.#coming.size + this.#residents - this.pageIn.length);
  }

  #isMissing(page: number): boolean {
    const above = this.#list.parent[page];
    const isNew = !this.isResident(page) && !this.#coming.has(page);
    return this.#wish[page] > 0 && isNew && (above === NONE || this.isResident(above));
  }

  #listMissing(): void {
    this.#missing.clear();
    for (let page = 0; page < this.#list.count; page++) {
      if (this.#isMissing(page)) this.#missing.add(page, this.#wish[page]);
    }
    this.#missing.order();
  }

  #listLeavers(): void {
    this.#leavers.clear();
    this.#isListed.fill(0);
    for (const page of this.pageIn.subarray(0, this.#residents)) {
      if (!this.#mayLeave(page)) continue;
      this.#isListed[page] = 1;
      this.#leavers.add(page, this.#spareRank(page));
    }
    this.#leavers.order();
    this.#setAside = [];
    for (let lacking = this.#lackingSlots; lacking > 0; lacking--) {
      const page = this.#nextLeaver();
      if (page !== NONE) this.#setAside.push(page);
    }
  }

  /** Never the coarsest page, nor one that has anything below it. */
  #mayLeave(page: number): boolean {
    return this.isResident(page) && this.#below[page] === 0 && this.#list.parent[page] !== NONE;
  }

  /** How well a page can be spared: best one not wished for the longest; of those wished for the least needed. */
  #spareRank(page: number): number {
    const age = this.#look - this.#wishedAt[page];
    return age > 0 ? age : -this.#wish[page];
  }

  /** Puts a page among those that may leave, if it may. */
  #offer(page: number): void {
    if (this.#isListed[page] === 1 || !this.#mayLeave(page)) return;
    this.#isListed[page] = 1;
    this.#leavers.push(page, this.#spareRank(page));
  }

  #return(page: number): void {
    this.#isListed[page] = 0;
    this.#offer(page);
  }

  /** Takes the page that can best be spared; it counts as listed until it has left or is returned. */
  #nextLeaver(): number {
    for (let page = this.#leavers.pop(); page !== NONE; page = this.#leavers.pop()) {
      if (this.#mayLeave(page)) return page;
      this.#isListed[page] = 0;
    }
    return NONE;
  }

  #isWorth(page: number, leaver: number): boolean {
    return this.#wishedAt[leaver] !== this.#look || WORTH * this.#wish[leaver] < this.#wish[page];
  }

  /** Sees to a slot for one page more than are on their way. */
  #makeRoom(page: number): boolean {
    const lacking = this.#coming.size + 1 + this.#residents - this.pageIn.length;
    while (this.#setAside.length < lacking) {
      const leaver = this.#nextLeaver();
      if (leaver === NONE) return false;
      if (!this.#isWorth(page, leaver)) {
        this.#return(leaver);
        return false;
      }
      this.#setAside.push(leaver);
    }
    return true;
  }

  /** The page that leaves for one that has come; {@link NONE} if none is needed so much less. */
  #leaverFor(page: number): number {
    let leaver = this.#setAside.shift() ?? NONE;
    if (leaver === NONE || !this.#mayLeave(leaver)) leaver = this.#nextLeaver();
    if (leaver === NONE) return NONE;
    if (!this.#isWorth(page, leaver)) {
      this.#return(leaver);
      return NONE;
    }
    this.#isListed[leaver] = 0;
    return leaver;
  }

  /** Something below a page is on its way: it must stay. */
  #hold(page: number): void {
    this.#below[page]++;
    const at = this.#setAside.indexOf(page);
    if (at < 0) return;
    this.#setAside.splice(at, 1);
    this.#isListed[page] = 0;
  }

  /** Something below a page has left or does not come. */
  #release(page: number): void {
    this.#below[page]--;
    this.#offer(page);
  }
}

/** Numbers of the pages below the chunks of a page, {@link NONE} where there is none. */
export const childrenOf = (list: PageList, page: number): Uint32Array =>
  list.children.subarray(PAGE_CHUNKS * page, PAGE_CHUNKS * page + list.chunks[page]);
