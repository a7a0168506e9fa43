import { GaussianSplatError, type Bounds, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { GaussianPage, GaussianScene } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { GpuMemory, withMemoryCheck } from '../gpu/memory.js';
import { MemoryLedger, type Reservation } from '../memory-ledger.js';
import type { ShPrecision } from '../pack/sh.js';
import { PAGE_CHUNKS, pageLayout, type DetailManifest } from './manifest.js';
import { DetailTable } from './detail-table.js';
import { listPages, NONE, type PageList } from './page-list.js';
import { movePage, PagePool, slotBytes } from './page-pool.js';
import { ARRIVED, PageRows } from './page-rows.js';
import { PageTraffic, type FetchedPage } from './page-traffic.js';
import { Residency } from './residency.js';
import { UploadPace } from './upload-pace.js';
import { WishReader } from './wish-reader.js';

export interface StreamOptions {
  /**
   * Fetches a page's file, named relative to the manifest; 8 at a time at most. Aborted when no view wishes for it any more, and when the scene is destroyed. Best done in a
   * worker: reading a response costs a thread more than all else that a page needs.
   */
  readonly fetchPage: (file: string, signal: AbortSignal) => Promise<ArrayBuffer>;
  /** Bytes of GPU memory that resident splats may take, allocated at once. Default 256 MB, or what the whole scene takes if that is less. */
  readonly memoryBudget?: number;
  /**
   * Milliseconds in which a page that has come takes the place of what stood for it, in {@link LEAST_STEPS} frames at least; 0 for at once. Default 400.
   */
  readonly arrivalMs?: number;
  /** Called when another frame is asked for: a page has come, or what the last view lacks is not known yet. */
  readonly onChange?: () => void;
  /** Called when a page does not come; what is above it stays on show, and it is asked for again after a while. */
  readonly onError?: (error: unknown) => void;
}

/** Fits a phone. */
const DEFAULT_BUDGET = 256e6;
const ARRIVAL_MS = 400;
/** Frames that a page takes to arrive at least, however slow they are. */
const LEAST_STEPS = 16;

/**
 * A scene of any size from static hosting, of which only those pages are on the GPU that the view asks for. The coarsest page is always
 * there; whatever is missing, what stands for it is drawn.
 *
 * Draw it with the lever `detail` above 0 or a `splatBudget`: without, every view asks for the finest pages.
 */
export class StreamedGaussians implements GaussianScene {
  /** Splats for which there is room. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  readonly antialiased: boolean;
  readonly origin: Vector3;
  readonly bounds: Bounds;
  readonly pages: readonly GaussianPage[];
  /** Wishes of the views: for the renderer. */
  readonly wishes: WishReader;
  readonly #list: PageList;
  readonly #manifest: DetailManifest;
  readonly #options: StreamOptions;
  readonly #memory: GpuMemory;
  readonly #reservation: Reservation;
  readonly #pool: PagePool;
  readonly #residency: Residency;
  readonly #traffic: PageTraffic;
  readonly #pace = new UploadPace();
  readonly #details: DetailTable;
  /** Of each slot. */
  readonly #rows: PageRows[];
  /** How much of their time has passed, 0 to 1, for the pages that arrive now. */
  readonly #arriving = new Map<number, number>();
  #steppedAt = 0;
  #isDestroyed = false;
  #uploaded = { pages: 0, bytes: 0, milliseconds: 0 };
  #version = 1;

  private constructor(device: GPUDevice, manifest: DetailManifest, options: StreamOptions) {
    const { shDegree, shPrecision, antialiased, origin, bounds } = manifest;
    [this.shDegree, this.shPrecision, this.antialiased, this.origin] = [shDegree, shPrecision, antialiased, origin];
    this.bounds = bounds;
    this.#manifest = manifest;
    this.#options = options;
    this.#list = listPages(manifest);
    const slots = slotsFor(manifest, this.#list.count, options.memoryBudget ?? DEFAULT_BUDGET);
    this.count = slots * PAGE_CHUNKS * constants.CULL_GROUP;
    this.#reservation = MemoryLedger.of(device).reserve('pages of a streamed scene', slots * slotBytes(manifest));
    this.#memory = new GpuMemory(device);
    try {
      this.#pool = new PagePool(device, this.#memory, manifest, slots);
      this.wishes = new WishReader(
        device,
        this.#memory,
        this.#list.count,
        (wishes) => this.#take(wishes),
        () => this.#options.onChange?.(),
      );
    } catch (error) {
      this.destroy();
      throw error;
    }
    this.pages = this.#pool.pages;
    this.#residency = new Residency(this.#list, slots);
    this.#traffic = new PageTraffic(this.#residency, {
      fetch: (page, signal) => this.#fetch(page, signal),
      onArrival: () => this.#options.onChange?.(),
      onError: (error) => this.#options.onError?.(error),
    });
    this.#details = new DetailTable(slots);
    this.#rows = Array.from({ length: slots }, (_, slot) => new PageRows(this.#details.rowsOf(slot)));
  }

  /**
   * Allocates the pool and fetches the coarsest page.
   * @param manifest see `checkManifest`
   * @throws GaussianSplatError `out-of-memory/*` if there is no room; what `fetchPage` throws, `decode/truncated` for a page of the wrong length.
   */
  static async open(device: GPUDevice, manifest: DetailManifest, options: StreamOptions): Promise<StreamedGaussians> {
    const what = `streamed scene of ${manifest.splats} splats`;
    const scene = await withMemoryCheck(device, what, () => new StreamedGaussians(device, manifest, options));
    try {
      scene.#residency.begin(0);
      scene.#place({ page: 0, words: await scene.#fetch(0, new AbortController().signal) });
      scene.#writeDetails();
      return scene;
    } catch (error) {
      scene.destroy();
      throw error;
    }
  }

  /** Grows with every page that comes. */
  get version(): number {
    return this.#version;
  }

  /** Bytes of GPU memory held. */
  get byteLength(): number {
    return this.#memory.byteLength;
  }

  /** Pages on the GPU, all pages, and pages that are on their way or still taking the place of others. */
  get progress(): { readonly resident: number; readonly total: number; readonly coming: number } {
    return {
      resident: this.#residency.residents,
      total: this.#list.count,
      coming: this.#traffic.underWay + this.#arriving.size,
    };
  }

  /** For each slot of the pool the page in it, as pages are numbered in the manifest; undefined for an empty one. */
  get pagesInSlots(): readonly (number | undefined)[] {
    return Array.from(this.#residency.pageIn, (page) => (page === NONE ? undefined : page));
  }

  /**
   * What has been done since the scene was opened: pages and bytes uploaded, milliseconds of the page's thread that it took, and pages that were sent for in vain, because
   * the view had moved on.
   */
  get traffic(): {
    readonly pages: number;
    readonly bytes: number;
    readonly milliseconds: number;
    readonly abandoned: number;
  } {
    return { ...this.#uploaded, abandoned: this.#traffic.abandoned };
  }

  /** Uploads some of what has come, and lets what came before arrive further. The renderer calls it before each frame. */
  update(): void {
    const start = performance.now();
    this.#step(start);
    this.#upload(this.#pace.startFrame(start));
    this.#writeDetails();
    this.#uploaded.milliseconds += performance.now() - start;
    this.#traffic.sendForMore();
    if (this.#traffic.waiting + this.#arriving.size > 0) queueMicrotask(() => this.#options.onChange?.());
  }

  destroy(): void {
    this.#isDestroyed = true;
    this.#traffic?.close();
    this.wishes?.destroy();
    this.#reservation.release();
    this.#memory.destroy();
  }

  /** Places the most needed of what waits: one page, and as many more as so many bytes are enough for. */
  #upload(most: number): void {
    const start = performance.now();
    let bytes = 0;
    while (bytes === 0 || bytes + slotBytes(this.#manifest) <= most) {
      const next = this.#traffic.next();
      if (next === undefined) break;
      if (!this.#place(next)) this.#traffic.refused();
      // A page that finds no slot has cost its share of the thread as well.
      bytes += next.words.byteLength;
    }
    if (bytes > 0) this.#pace.note(bytes, performance.now() - start);
  }

  /** Puts a page into a slot; all that must be drawn otherwise for it changes with the same frame. @returns false if there is no slot for it */
  #place({ page, words }: FetchedPage): boolean {
    const place = this.#residency.settle(page);
    if (place === undefined) return false;
    const { slot, left } = place;
    const { upper, parent, parentChunk, chunks } = this.#list;
    movePage(words, this.#list.translate(page), this.#manifest, chunks[page]);
    this.#pool.write(slot, words, chunks[page]);
    if (left !== NONE) this.#leave(left);
    const rows = this.#rows[slot];
    rows.load(this.#list, this.#manifest, page, words);
    if (parent[page] !== NONE) rows.setAbove(upper[page], this.#rowsOf(parent[page]).above(parentChunk[page]));
    const isAtOnce = parent[page] === NONE || this.#options.arrivalMs === 0;
    if (!isAtOnce) this.#arriving.set(page, 0);
    this.#setArrived(page, isAtOnce ? ARRIVED : 0);
    this.#uploaded.pages++;
    this.#uploaded.bytes += words.byteLength;
    this.#version++;
    return true;
  }

  /** Lets arriving pages take the place of what stood for them by another step; none before the page above it. */
  #step(now: number): void {
    const passed = (now - this.#steppedAt) / (this.#options.arrivalMs ?? ARRIVAL_MS);
    this.#steppedAt = now;
    if (this.#arriving.size === 0) return;
    const step = Math.min(1 / LEAST_STEPS, passed);
    for (const [page, before] of this.#arriving) {
      const most = this.#arriving.get(this.#list.parent[page]) ?? 1;
      const passedNow = Math.min(most, before + step);
      if (passedNow === 1) this.#arriving.delete(page);
      else this.#arriving.set(page, passedNow);
      this.#setArrived(page, Math.round(ARRIVED * eased(passedNow)));
    }
    this.#version++;
  }

  #rowsOf(page: number): PageRows {
    return this.#rows[this.#residency.slotOf[page]];
  }

  /** How far a page has arrived: so far the chunk above gives way to it. */
  #setArrived(page: number, arrived: number): void {
    this.#rowsOf(page).setArrived(arrived);
    this.#details.touch(this.#residency.slotOf[page]);
    this.#setBelow(page, arrived);
  }

  /** A page that is about to be overwritten: the chunk above is drawn again. */
  #leave(page: number): void {
    this.#arriving.delete(page);
    this.#setBelow(page, 0);
  }

  #setBelow(page: number, arrived: number): void {
    const parent = this.#list.parent[page];
    if (parent === NONE) return;
    this.#rowsOf(parent).setBelow(this.#list.parentChunk[page], arrived);
    this.#details.touch(this.#residency.slotOf[parent]);
  }

  #writeDetails(): void {
    this.#details.flush(this.#pool.slotsPerBuffer, (first, rows) => this.#pool.writeDetails(first, rows));
  }

  #take(wishes: Float32Array): void {
    if (this.#isDestroyed) return;
    this.#residency.note(wishes);
    this.#traffic.follow();
  }

  async #fetch(page: number, signal: AbortSignal): Promise<Uint32Array<ArrayBuffer>> {
    const file = this.#list.file(page);
    const bytes = await this.#options.fetchPage(file, signal);
    signal.throwIfAborted();
    const expected = 4 * pageLayout(this.#manifest, this.#list.chunks[page]).total;
    if (bytes.byteLength === expected) return new Uint32Array(bytes);
    throw new GaussianSplatError('decode/truncated', {
      where: file,
      expected: `${expected} bytes`,
      found: `${bytes.byteLength} bytes`,
      remedy: 'upload the folder again, all files of it from one run of npm run detail',
    });
  }
}

/** Slow at both ends: an opaque splat in the share w has the opacity 1 − (1 − a)^w, which is a third at the first of sixteen even steps. */
const eased = (t: number): number => t * t * (3 - 2 * t);

function slotsFor(manifest: DetailManifest, pages: number, budget: number): number {
  const slots = Math.min(pages, Math.floor(budget / slotBytes(manifest)));
  if (slots >= 1) return slots;
  throw new GaussianSplatError('out-of-memory/budget', {
    where: 'streamed scene',
    expected: `at least ${slotBytes(manifest)} bytes of GPU memory for one page`,
    found: `${Math.floor(budget)} bytes (memoryBudget)`,
    remedy: 'raise the budget',
  });
}
