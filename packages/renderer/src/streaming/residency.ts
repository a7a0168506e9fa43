import { RankedHeap } from '../ranked-heap.js';
import { largerThan, NONE, type PageList } from './page-list.js';
import { PageSlots, type Settled } from './page-slots.js';

/** How much more pixels a page must save than one that has to leave for it, both being wished for. */
const WORTH = 1.5;
/** How many times sooner than by its need a page is sent for that need not be fetched. */
const AT_HAND = 4;
/** Looks in a row that must not wish for a page on its way before it is given up: views that look in turn wish for different pages. */
const STALE_AFTER = 2;

/**
 * Which pages are in which slots, and which should come and go. The chunks above a page are there as long as the page is: pages come from the coarse to the fine
 * and leave from the fine to the coarse, so that what is there always covers the scene. A page is there in all of its slots or not at all; one that has no room beside
 * all that is above it never comes.
 *
 * A look costs time linear in the pages, a page that comes or goes the logarithm of it.
 */
export class Residency {
  readonly #slots: PageSlots;
  readonly #list: PageList;
  readonly #isCached: (page: number) => boolean;
  /** [P] pixels that doing without a page would cost, when last looked, and at which look it was last wished for. */
  readonly #request: Float32Array;
  readonly #requestedAt: Uint32Array;
  /** [P] pages below a page that are there or on their way. */
  readonly #below: Uint32Array;
  /** [P] 1 for those that have no room beside all that is above them. */
  readonly #isTooLarge: Uint8Array;
  readonly #coming = new Set<number>();
  readonly #missing: RankedHeap;
  /** Pages that may leave, those that can best be spared first. */
  readonly #evictees: RankedHeap;
  /** [P] 1 for those that are among the leavers or set aside. */
  readonly #isListed: Uint8Array;
  /** Pages that will leave for those on their way that find no empty slot, in the order in which they will; drawn until then. */
  #reserved: number[] = [];
  /** Slots of those, and of pages on their way. */
  #slotsAside = 0;
  #slotsComing = 0;
  /** The last look has found no room for a page of so many slots that was needed so much. */
  #noRoom = { slots: Infinity, need: 0 };
  #sample = 0;

  /** @param isCached true for a page that need not be fetched */
  constructor(list: PageList, slots: number, isCached: (page: number) => boolean = () => false) {
    this.#list = list;
    this.#isCached = isCached;
    this.#slots = new PageSlots(list.count, slots);
    this.#request = new Float32Array(list.count);
    this.#requestedAt = new Uint32Array(list.count);
    this.#below = new Uint32Array(list.count);
    this.#isTooLarge = largerThan(slots, list);
    this.#isListed = new Uint8Array(list.count);
    this.#missing = new RankedHeap(list.count);
    this.#evictees = new RankedHeap(slots);
  }

  /** [S] page in each slot, or {@link NONE}. */
  get pageIn(): Uint32Array {
    return this.#slots.pageIn;
  }

  /** [P] first slot of each page, or {@link NONE}. */
  get slotOf(): Uint32Array {
    return this.#slots.slotOf;
  }

  isResident(page: number): boolean {
    return this.slotOf[page] !== NONE;
  }

  /** Slots of a page that is there, in the order of its chunks; none of another. */
  slotsOf(page: number): readonly number[] {
    return this.#slots.of(page);
  }

  /** Slots that a page takes. */
  slotsFor(page: number): number {
    return this.#list.slots[page];
  }

  /** Pages that are there. */
  get residents(): number {
    return this.#slots.count;
  }

  /** Pixels that doing without a page would cost, as of the last look; 0 if that does not wish for it. */
  need(page: number): number {
    return this.#request[page];
  }

  /** True for a page that the last looks have not wished for. */
  isStale(page: number): boolean {
    return this.#sample - this.#requestedAt[page] >= STALE_AFTER;
  }

  /** Takes note of a look: for each page the pixels that doing without it would cost, 0 for those that nobody wishes for. */
  note(requests: Float32Array): void {
    this.#sample++;
    this.#noRoom = { slots: Infinity, need: 0 };
    this.#request.set(requests.subarray(0, this.#list.count));
    for (let page = 0; page < this.#list.count; page++) {
      if (requests[page] > 0) this.#requestedAt[page] = this.#sample;
    }
    this.#listMissing();
    this.#rankEvictable();
  }

  /**
   * Takes the most needed page from those that the last look wishes for and that are neither there nor on their way, though what is above them is.
   * @returns {@link NONE} if there is none
   */
  nextMissing(): number {
    // Thousands may find no room: none is tried that is needed no more, and takes no less, than one that has found none.
    const { slots, need } = this.#noRoom;
    while (slots > 1 || this.#missing.largest > need) {
      const page = this.#missing.pop();
      if (page === NONE) return NONE;
      const hasNoRoom = this.#list.slots[page] >= slots && this.#request[page] <= need;
      if (!hasNoRoom && this.#isMissing(page)) return page;
    }
    return NONE;
  }

  /** Lets {@link nextMissing} name again all that the last look wishes for and that is missing, whatever has found no room. */
  rebuildMissing(): void {
    this.#noRoom = { slots: Infinity, need: 0 };
    this.#listMissing();
  }

  /** Starts bringing a page if there is room for it, or something to leave that is needed less; if not, nothing as large that is needed no more is missing until the next look. */
  begin(page: number): boolean {
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#hold(parent);
    if (!this.#makeRoom(page)) {
      if (parent !== NONE) this.#release(parent);
      this.#noteNoRoom(this.#list.slots[page], this.#request[page]);
      return false;
    }
    this.#coming.add(page);
    this.#slotsComing += this.#list.slots[page];
    return true;
  }

  /** A page that was on its way does not come. */
  cancel(page: number): void {
    if (!this.#coming.delete(page)) return;
    this.#slotsComing -= this.#list.slots[page];
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#release(parent);
    while (this.#reserved.length > 0) {
      const last = this.#reserved.at(-1)!;
      if (this.#slotsAside - this.#list.slots[last] < this.#lackingSlots) return;
      this.#putBack();
    }
  }

  /** A page has come. @returns its slots and the pages that left for it; undefined if there is no room any more. */
  settle(page: number): Settled | undefined {
    const evictees = this.#evicteesFor(page);
    if (evictees === undefined) {
      this.cancel(page);
      return undefined;
    }
    const left = evictees.map((evictee) => ({ page: evictee, slots: this.#slots.clear(evictee) }));
    this.#coming.delete(page);
    this.#slotsComing -= this.#list.slots[page];
    const slots = this.#slots.fill(page, this.#list.slots[page]);
    for (const evictee of evictees) {
      this.#isListed[evictee] = 0;
      this.#release(this.#list.parent[evictee]);
    }
    this.#offer(page);
    return { slots, left };
  }

  /** Slots that pages on their way will need and not find empty. */
  get #lackingSlots(): number {
    return Math.max(0, this.#slotsComing - this.#slots.empty);
  }

  #noteNoRoom(slots: number, need: number): void {
    const before = this.#noRoom;
    if (slots > before.slots) return;
    this.#noRoom = { slots, need: slots === before.slots ? Math.max(need, before.need) : need };
  }

  #isMissing(page: number): boolean {
    const above = this.#list.parent[page];
    const isNew = !this.isResident(page) && !this.#coming.has(page) && this.#isTooLarge[page] === 0;
    return this.#request[page] > 0 && isNew && (above === NONE || this.isResident(above));
  }

  #listMissing(): void {
    this.#missing.clear();
    for (let page = 0; page < this.#list.count; page++) {
      if (this.#request[page] === 0 || !this.#isMissing(page)) continue;
      this.#missing.add(page, this.#request[page] * (this.#isCached(page) ? AT_HAND : 1));
    }
    this.#missing.order();
  }

  #rankEvictable(): void {
    this.#evictees.clear();
    this.#isListed.fill(0);
    for (const page of this.#slots.pages()) {
      if (!this.#isEvictable(page)) continue;
      this.#isListed[page] = 1;
      this.#evictees.add(page, this.#evictionPriority(page));
    }
    this.#evictees.order();
    this.#reserved = [];
    this.#slotsAside = 0;
    while (this.#slotsAside < this.#lackingSlots) {
      const page = this.#nextEvictable();
      if (page === NONE) return;
      this.#putAside(page);
    }
  }

  /** Never the coarsest page, nor one that has anything below it. */
  #isEvictable(page: number): boolean {
    return this.isResident(page) && this.#below[page] === 0 && this.#list.parent[page] !== NONE;
  }

  /** How well a page can be spared: best one not wished for the longest; of those wished for the least needed. */
  #evictionPriority(page: number): number {
    const age = this.#sample - this.#requestedAt[page];
    return age > 0 ? age : -this.#request[page];
  }

  /** Puts a page among those that may leave, if it may. */
  #offer(page: number): void {
    if (this.#isListed[page] === 1 || !this.#isEvictable(page)) return;
    this.#isListed[page] = 1;
    this.#evictees.push(page, this.#evictionPriority(page));
  }

  #return(page: number): void {
    this.#isListed[page] = 0;
    this.#offer(page);
  }

  /** Takes the page that can best be spared; it counts as listed until it has left or is returned. */
  #nextEvictable(): number {
    for (let page = this.#evictees.pop(); page !== NONE; page = this.#evictees.pop()) {
      if (this.#isEvictable(page)) return page;
      this.#isListed[page] = 0;
    }
    return NONE;
  }

  #putAside(page: number): void {
    this.#reserved.push(page);
    this.#slotsAside += this.#list.slots[page];
  }

  /** Returns what was set aside last. */
  #putBack(): void {
    const page = this.#reserved.pop()!;
    this.#slotsAside -= this.#list.slots[page];
    this.#return(page);
  }

  #isWorth(page: number, evictee: number): boolean {
    return this.#requestedAt[evictee] !== this.#sample || WORTH * this.#request[evictee] < this.#request[page];
  }

  /** Sees to slots for one page more than are on their way. */
  #makeRoom(page: number): boolean {
    const lacking = this.#slotsComing + this.#list.slots[page] - this.#slots.empty;
    const before = this.#reserved.length;
    while (this.#slotsAside < lacking) {
      const evictee = this.#nextEvictable();
      if (evictee !== NONE && this.#isWorth(page, evictee)) {
        this.#putAside(evictee);
        continue;
      }
      if (evictee !== NONE) this.#return(evictee);
      while (this.#reserved.length > before) this.#putBack();
      return false;
    }
    return true;
  }

  /** The pages that leave for one that has come; undefined if too few are needed so much less. */
  #evicteesFor(page: number): number[] | undefined {
    const evictees: number[] = [];
    for (let room = this.#slots.empty; room < this.#list.slots[page];) {
      const aside = this.#reserved.shift();
      if (aside !== undefined) this.#slotsAside -= this.#list.slots[aside];
      const evictee = aside !== undefined && this.#isEvictable(aside) ? aside : this.#nextEvictable();
      if (evictee !== NONE) evictees.push(evictee);
      if (evictee === NONE || !this.#isWorth(page, evictee)) {
        evictees.forEach((spared) => this.#return(spared));
        return undefined;
      }
      room += this.#list.slots[evictee];
    }
    return evictees;
  }

  /** Something below a page is on its way: it must stay. */
  #hold(page: number): void {
    this.#below[page]++;
    const at = this.#reserved.indexOf(page);
    if (at < 0) return;
    this.#reserved.splice(at, 1);
    this.#slotsAside -= this.#list.slots[page];
    this.#isListed[page] = 0;
  }

  /** Something below a page has left or does not come. */
  #release(page: number): void {
    this.#below[page]--;
    this.#offer(page);
  }
}
