import { RankedHeap } from '../ranked-heap.js';
import { NONE, type PageList } from './page-list.js';
import { PageSlots, type Settled } from './page-slots.js';

/** Factor by which a requested page must be more needed than a requested page that is evicted for it. */
const WORTH = 1.5;
/** Factor of the need of a page that is cached, in the order of fetches. */
const AT_HAND = 4;
/**
 * Number of consecutive feedback passes without a request for a page in transit before it is canceled. Alternating
 * views request different pages.
 */
const STALE_AFTER = 2;

/**
 * Decides which pages are resident, fetched and evicted. The ancestors of a resident page are always resident. Pages
 * arrive from coarse to fine and are evicted from fine to coarse, so that the resident pages always cover the scene. A
 * page is resident in all of its slots or in none. A page that does not fit together with its ancestors is never
 * fetched.
 *
 * A feedback pass costs time linear in the number of pages. The arrival or eviction of a page costs logarithmic time.
 */
export class Residency {
  /** The slots of the resident pages. */
  readonly slots: PageSlots;
  readonly #list: PageList;
  readonly #isCached: (page: number) => boolean;
  /** [P] screen error of a missing page in pixels, from the last feedback pass; 0 if it is not requested. */
  readonly #request: Float32Array;
  /** [P] index of the last feedback pass that requested each page. */
  readonly #requestedAt: Uint32Array;
  /** [P] number of descendants of a page that are resident or in transit. */
  readonly #below: Uint32Array;
  /** [P] number of slots of a page together with its ancestors; see {@link #extend}. */
  readonly #slotsAbove: Float64Array;
  /** Number of pages whose {@link #slotsAbove} is known. */
  #extent = 0;
  /** Pages in transit, and the number of slots that are reserved for each. */
  readonly #coming = new Map<number, number>();
  readonly #missing: RankedHeap;
  /** Evictable pages, least needed first. */
  readonly #evictees: RankedHeap;
  /** [P] 1 for pages that are listed as evictable or reserved for eviction. */
  readonly #isListed: Uint8Array;
  /**
   * Pages reserved for eviction, in order, because pages in transit need more than the empty slots. They are drawn
   * until then.
   */
  #reserved: number[] = [];
  /** Number of slots of the reserved pages. */
  #slotsAside = 0;
  /** Number of slots of the pages in transit. */
  #slotsComing = 0;
  /** Number of slots and need of the smallest page that did not fit since the last feedback pass. */
  #noRoom = { slots: Infinity, need: 0 };
  /** Index of the last feedback pass. */
  #sample = 0;

  /**
   * @param slots Number of slots in the pool.
   * @param isCached Returns whether a page is available without a fetch.
   */
  constructor(list: PageList, slots: number, isCached: (page: number) => boolean = () => false) {
    this.#list = list;
    this.#isCached = isCached;
    const pages = list.capacity ?? list.count;
    this.slots = new PageSlots(pages, slots);
    this.#request = new Float32Array(pages);
    this.#requestedAt = new Uint32Array(pages);
    this.#below = new Uint32Array(pages);
    this.#slotsAbove = new Float64Array(pages);
    this.#isListed = new Uint8Array(pages);
    this.#missing = new RankedHeap(pages);
    this.#extend();
    this.#evictees = new RankedHeap(slots);
  }

  isResident(page: number): boolean {
    return this.slots.slotOf[page] !== NONE;
  }

  /** Returns the number of slots that a page needs. */
  slotsFor(page: number): number {
    return this.#list.slots[page];
  }

  /** Number of slots of the resident pages. */
  get slotsInUse(): number {
    return this.slots.pageIn.length - this.slots.empty;
  }

  /** Number of chunks of the resident pages. */
  get chunks(): number {
    let chunks = 0;
    for (const page of this.slots.pages()) chunks += this.#list.chunks[page];
    return chunks;
  }

  /** Whether a page that the last feedback pass requested found no slots. */
  get lacksSlots(): boolean {
    if (this.#noRoom.slots < Infinity) return true;
    return this.#request.some((pixels, page) => pixels > 0 && this.#isTooLarge(page));
  }

  /**
   * Returns the screen error of a missing page in pixels, from the last feedback pass; 0 if the page is not requested.
   */
  need(page: number): number {
    return this.#request[page];
  }

  /** Whether the last {@link STALE_AFTER} feedback passes have not requested the page. */
  isStale(page: number): boolean {
    return this.#sample - this.#requestedAt[page] >= STALE_AFTER;
  }

  /**
   * Records a feedback pass.
   * @param requests [P] screen error in pixels of each missing page; 0 if it is not requested.
   */
  note(requests: Float32Array): void {
    this.#extend();
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
   * Removes and returns the most needed of the missing pages: requested, neither resident nor in transit, and with a
   * resident parent or none.
   * @returns Index of the page; {@link NONE} if there is none.
   */
  nextMissing(): number {
    // Thousands of pages may not fit. The loop skips pages that need at least as many slots, and are at most as needed,
    // as one that did not fit.
    const { slots, need } = this.#noRoom;
    while (slots > 1 || this.#missing.largest > need) {
      const page = this.#missing.pop();
      if (page === NONE) return NONE;
      const hasNoRoom = this.#list.slots[page] >= slots && this.#request[page] <= need;
      if (!hasNoRoom && this.#isMissing(page)) return page;
    }
    return NONE;
  }

  /** Makes {@link nextMissing} return all requested missing pages again, even those that did not fit. */
  rebuildMissing(): void {
    this.#noRoom = { slots: Infinity, need: 0 };
    this.#listMissing();
  }

  /**
   * Reserves slots for a page that is to be fetched: empty slots, or those of less needed pages. If there are too few,
   * pages of this size with at most this need are skipped until the next feedback pass.
   * @returns Whether slots are reserved.
   */
  begin(page: number): boolean {
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#hold(parent);
    if (!this.#makeRoom(page)) {
      if (parent !== NONE) this.#release(parent);
      this.#noteNoRoom(this.#list.slots[page], this.#request[page]);
      return false;
    }
    this.#coming.set(page, this.#list.slots[page]);
    this.#slotsComing += this.#list.slots[page];
    return true;
  }

  /** Cancels a page in transit, and releases its reserved slots. Does nothing for other pages. */
  cancel(page: number): void {
    if (!this.#arrive(page)) return;
    const parent = this.#list.parent[page];
    if (parent !== NONE) this.#release(parent);
    while (this.#reserved.length > 0) {
      const last = this.#reserved.at(-1)!;
      if (this.#slotsAside - this.#list.slots[last] < this.#lackingSlots) return;
      this.#putBack();
    }
  }

  /**
   * Makes a page in transit resident.
   * @returns Its slots, and the pages that were evicted for it; undefined if the page no longer fits.
   */
  settle(page: number): Settled | undefined {
    const evictees = this.#evicteesFor(page);
    if (evictees === undefined) {
      this.cancel(page);
      return undefined;
    }
    const left = evictees.map((evictee) => ({ page: evictee, slots: this.slots.clear(evictee) }));
    this.#arrive(page);
    const slots = this.slots.fill(page, this.#list.slots[page]);
    for (const evictee of evictees) {
      this.#isListed[evictee] = 0;
      this.#release(this.#list.parent[evictee]);
    }
    this.#offer(page);
    return { slots, left };
  }

  /** Computes {@link #slotsAbove} of pages that were appended to the list. Parents precede their children. */
  #extend(): void {
    while (this.#extent < this.#list.count) this.#measure(this.#extent++);
  }

  #measure(page: number): void {
    const above = this.#list.parent[page];
    this.#slotsAbove[page] = this.#list.slots[page] + (above === NONE ? 0 : this.#slotsAbove[above]);
  }

  /** Whether a page does not fit in the pool together with its ancestors. */
  #isTooLarge(page: number): boolean {
    const { capacity, chunks } = this.#list;
    // The size of a page whose chunks are unknown is a guess, which is no reason not to fetch it.
    if (capacity !== undefined && chunks[page] === 0) return false;
    return this.#slotsAbove[page] > this.slots.pageIn.length;
  }

  /** Ends the transit of a page, and releases its reservation. @returns False if the page was not in transit. */
  #arrive(page: number): boolean {
    this.#slotsComing -= this.#coming.get(page) ?? 0;
    // Its number of slots may have become known.
    this.#measure(page);
    return this.#coming.delete(page);
  }

  /** Number of slots that pages in transit need beyond the empty ones. */
  get #lackingSlots(): number {
    return Math.max(0, this.#slotsComing - this.slots.empty);
  }

  #noteNoRoom(slots: number, need: number): void {
    const before = this.#noRoom;
    if (slots > before.slots) return;
    this.#noRoom = { slots, need: slots === before.slots ? Math.max(need, before.need) : need };
  }

  #isMissing(page: number): boolean {
    const above = this.#list.parent[page];
    const isNew = !this.isResident(page) && !this.#coming.has(page) && !this.#isTooLarge(page);
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
    for (const page of this.slots.pages()) {
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

  /** Whether a page may be evicted. The coarsest page, and pages with resident descendants, are never evicted. */
  #isEvictable(page: number): boolean {
    return this.isResident(page) && this.#below[page] === 0 && this.#list.parent[page] !== NONE;
  }

  /**
   * Returns the eviction priority of a page, largest first. Pages that were not requested for the longest time come
   * first; among requested ones the least needed comes first.
   */
  #evictionPriority(page: number): number {
    const age = this.#sample - this.#requestedAt[page];
    return age > 0 ? age : -this.#request[page];
  }

  /** Adds a page to the list of evictable pages if it may be evicted. */
  #offer(page: number): void {
    if (this.#isListed[page] === 1 || !this.#isEvictable(page)) return;
    this.#isListed[page] = 1;
    this.#evictees.push(page, this.#evictionPriority(page));
  }

  #return(page: number): void {
    this.#isListed[page] = 0;
    this.#offer(page);
  }

  /**
   * Removes and returns the first evictable page, or {@link NONE}. The page counts as listed until it is evicted or
   * returned.
   */
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

  /** Moves the last reserved page back to the list of evictable pages. */
  #putBack(): void {
    const page = this.#reserved.pop()!;
    this.#slotsAside -= this.#list.slots[page];
    this.#return(page);
  }

  #isWorth(page: number, evictee: number): boolean {
    return this.#requestedAt[evictee] !== this.#sample || WORTH * this.#request[evictee] < this.#request[page];
  }

  /**
   * Reserves slots for one more page in transit. Returns false, and reserves nothing, if too few pages are less needed.
   */
  #makeRoom(page: number): boolean {
    const lacking = this.#slotsComing + this.#list.slots[page] - this.slots.empty;
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

  /** Returns the pages to evict for a new page; undefined if too few pages are sufficiently less needed. */
  #evicteesFor(page: number): number[] | undefined {
    const evictees: number[] = [];
    for (let room = this.slots.empty; room < this.#list.slots[page];) {
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

  /** Keeps a page resident for a descendant in transit. */
  #hold(page: number): void {
    this.#below[page]++;
    const at = this.#reserved.indexOf(page);
    if (at < 0) return;
    this.#reserved.splice(at, 1);
    this.#slotsAside -= this.#list.slots[page];
    this.#isListed[page] = 0;
  }

  /** Releases a page after a descendant was evicted or canceled. */
  #release(page: number): void {
    this.#below[page]--;
    this.#offer(page);
  }
}
