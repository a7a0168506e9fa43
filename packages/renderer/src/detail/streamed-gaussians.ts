import { GaussianSplatError, type Bounds, type ShDegree, type Vector3 } from '@gaussian-splat/core';
import type { GaussianPage, GaussianScene } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { GpuMemory, withMemoryCheck } from '../gpu/memory.js';
import { MemoryLedger, type Reservation } from '../memory-ledger.js';
import type { ShPrecision } from '../pack/sh.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from './chunk-detail.js';
import { PAGE_CHUNKS, pageLayout, type DetailManifest } from './manifest.js';
import { childrenOf, Residency } from './residency.js';
import { listPages, NONE, type PageList } from './page-list.js';
import { movePage, PagePool, slotBytes } from './page-pool.js';
import { WishReader } from './wish-reader.js';

export interface StreamOptions {
  /** Fetches a page's file, named relative to the manifest. Aborted when the scene is destroyed. */
  readonly fetchPage: (file: string, signal: AbortSignal) => Promise<ArrayBuffer>;
  /** Bytes of GPU memory that resident splats may take, allocated at once. Default 256 MB, or what the whole scene takes if that is less. */
  readonly memoryBudget?: number;
  /** Called when another frame is asked for: a page has come, or what the last view lacks is not known yet. */
  readonly onChange?: () => void;
  /** Called when a page does not come; what is above it stays on show, and it is asked for again after a while. */
  readonly onError?: (error: unknown) => void;
}

/** Fits a phone. */
const DEFAULT_BUDGET = 256e6;
/** Pages on their way at a time, and uploaded before one frame. */
const MOST_COMING = 8;
const MOST_UPLOADS = 4;
/** Milliseconds before a page that did not come is asked for again. */
const RETRY_MS = 4_000;

interface Arrival {
  readonly page: number;
  readonly words: Uint32Array<ArrayBuffer>;
}

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
  /** Detail rows of each slot, as on the GPU. */
  readonly #rows: Float32Array<ArrayBuffer>[];
  readonly #abort = new AbortController();
  readonly #failedAt = new Map<number, number>();
  #arrivals: Arrival[] = [];
  #coming = 0;
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
    this.#rows = Array.from({ length: slots }, () => new Float32Array(DETAIL_NUMBERS * PAGE_CHUNKS));
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
      scene.#arrivals.push({ page: 0, words: await scene.#fetch(0) });
      scene.update();
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

  /** Pages on the GPU, all pages, and pages on their way. */
  get progress(): { readonly resident: number; readonly total: number; readonly coming: number } {
    return {
      resident: this.#residency.residents,
      total: this.#list.count,
      coming: this.#coming + this.#arrivals.length,
    };
  }

  /** For each slot of the pool the page in it, as pages are numbered in the manifest; undefined for an empty one. */
  get pagesInSlots(): readonly (number | undefined)[] {
    return Array.from(this.#residency.pageIn, (page) => (page === NONE ? undefined : page));
  }

  /** Uploads some of what has come. The renderer calls it before each frame. */
  update(): void {
    const arrivals = this.#arrivals.splice(0, MOST_UPLOADS);
    for (const arrival of arrivals) this.#place(arrival);
    if (this.#arrivals.length > 0) queueMicrotask(() => this.#options.onChange?.());
  }

  destroy(): void {
    this.#abort.abort();
    this.wishes?.destroy();
    this.#arrivals = [];
    this.#reservation.release();
    this.#memory.destroy();
  }

  /** Puts a page into a slot; all that must be drawn otherwise for it changes with the same frame. */
  #place({ page, words }: Arrival): void {
    const place = this.#residency.settle(page);
    if (place === undefined) return;
    const { slot, left } = place;
    const chunks = this.#list.chunks[page];
    movePage(words, this.#list.translate(page), this.#manifest, chunks);
    this.#pool.write(slot, words, chunks);
    if (left !== NONE) this.#setError(left, 'none');
    this.#rows[slot].set(this.#rowsOf(page, words));
    this.#pool.writeDetails(slot, this.#rows[slot]);
    if (this.#list.parent[page] !== NONE) this.#setError(page, 'full');
    this.#version++;
  }

  /** Rows of a page as they must be now: nothing below its finest chunks yet, and what is above them as that is in its slot. */
  #rowsOf(page: number, words: Uint32Array<ArrayBuffer>): Float32Array<ArrayBuffer> {
    const layout = pageLayout(this.#manifest, this.#list.chunks[page]);
    const rows = new Float32Array(DETAIL_NUMBERS * PAGE_CHUNKS);
    rows.set(new Float32Array(words.buffer, words.byteOffset + 4 * layout.chunks, layout.details));
    const numbers = new Uint32Array(rows.buffer);
    childrenOf(this.#list, page).forEach((child, chunk) => {
      const at = DETAIL_NUMBERS * chunk;
      numbers[at + DETAIL_PLACES.children] = child;
      if (child !== NONE) rows[at + DETAIL_PLACES.error] = 0;
    });
    if (this.#list.parent[page] !== NONE) this.#takeParent(page, rows);
    return rows;
  }

  /** The first chunks of a page, which have their parent in another, take its sphere and error over. */
  #takeParent(page: number, rows: Float32Array): void {
    const above = this.#rows[this.#residency.slotOf[this.#list.parent[page]]];
    const at = DETAIL_NUMBERS * this.#list.parentChunk[page];
    const sphere = above.subarray(at + DETAIL_PLACES.sphere, at + DETAIL_PLACES.sphere + 4);
    for (let chunk = 0; chunk < this.#list.upper[page]; chunk++) {
      rows.set(sphere, DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentSphere);
      rows[DETAIL_NUMBERS * chunk + DETAIL_PLACES.parentError] = above[at + DETAIL_PLACES.fullError];
    }
  }

  /** The chunk above a page gives way to it, or does not. */
  #setError(page: number, which: 'full' | 'none'): void {
    const slot = this.#residency.slotOf[this.#list.parent[page]];
    const at = DETAIL_NUMBERS * this.#list.parentChunk[page];
    const rows = this.#rows[slot];
    rows[at + DETAIL_PLACES.error] = which === 'full' ? rows[at + DETAIL_PLACES.fullError] : 0;
    this.#pool.writeDetails(slot, rows);
  }

  #take(wishes: Float32Array): void {
    if (this.#abort.signal.aborted) return;
    this.#residency.note(wishes);
    for (const page of this.#residency.missing) {
      if (this.#coming >= MOST_COMING) break;
      if (performance.now() - (this.#failedAt.get(page) ?? -Infinity) < RETRY_MS) continue;
      if (this.#residency.begin(page)) void this.#bring(page);
    }
  }

  async #bring(page: number): Promise<void> {
    this.#coming++;
    try {
      this.#arrivals.push({ page, words: await this.#fetch(page) });
      this.#failedAt.delete(page);
    } catch (error) {
      this.#residency.giveUp(page);
      this.#failedAt.set(page, performance.now());
      if (!this.#abort.signal.aborted) this.#options.onError?.(error);
    } finally {
      this.#coming--;
    }
    if (!this.#abort.signal.aborted) this.#options.onChange?.();
  }

  async #fetch(page: number): Promise<Uint32Array<ArrayBuffer>> {
    const file = this.#list.file(page);
    const bytes = await this.#options.fetchPage(file, this.#abort.signal);
    this.#abort.signal.throwIfAborted();
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
