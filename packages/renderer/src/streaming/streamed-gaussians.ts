import { GaussianSplatError, type Bounds, type TrainedOrder, type Vector3 } from '@gaussian-splat/core';
import type { GaussianBlock } from '../gaussian-scene.js';
import { constants } from '../generated/shaders.js';
import { type GpuMemory, withMemoryCheck } from '../gpu/memory.js';
import { SceneBuffers } from '../scene-buffers.js';
import { detailBudgetOn, type DetailBudget } from '../stages/detail-budget.js';
import { ARRIVAL_MS, PageFadeIn } from './page-fade-in.js';
import { SLOT_CHUNKS, type DetailManifest } from './manifest.js';
import { NONE } from './page-list.js';
import { PagePool, poolBytes, poolSize, slotBytes } from './page-pool.js';
import { folderSource, type FetchPage, type PageSource } from './page-source.js';
import { PageStreamer } from './page-streamer.js';
import { progressOf, type StreamProgress } from './progress.js';
import { TranslatedRows } from './translated-rows.js';
import { Residency } from './residency.js';
import type { SlotWords } from './slot-words.js';
import { UploadBudget } from './upload-budget.js';
import { aheadMs } from './camera-motion.js';
import { PageFeedback } from './page-feedback.js';

export interface PoolOptions {
  /**
   * Limit of the GPU memory for resident splats in bytes. The memory is allocated at once, up to a 32nd of it for
   * staging. Default: 256 MB, or the size of the whole scene if that is less.
   */
  readonly memoryBudget?: number;
  /**
   * Duration in milliseconds of the fade-in of a page over its parent, which takes at least 16 frames; 0 for none.
   * Default 400.
   */
  readonly arrivalMs?: number;
  /**
   * Cancels the opening of the scene, which rejects with the reason of the signal and frees its memory. Has no effect
   * once the scene is open.
   */
  readonly signal?: AbortSignal;
  /** Called when another frame is required: a page has arrived, or the last view has no feedback pass yet. */
  readonly onChange?: () => void;
  /**
   * Called when a page fails; its parent stays visible. The page is requested again after 4 s, and after twice as long
   * for each further failure, up to 256 s.
   */
  readonly onError?: (error: unknown) => void;
}

export interface StreamOptions extends PoolOptions {
  /**
   * Fetches a file of pages, whose name is relative to the manifest; at most 64 fetches are concurrent. The signal
   * aborts when no view needs any page of the file, and when the scene is destroyed. Fetch in a worker if possible:
   * reading a response costs a thread more time than all other work for a page.
   */
  readonly fetchPage: FetchPage;
  /**
   * Whether {@link fetchPage} decodes the files of a manifest with a `coding`, by `decodePage`. Default false: they are
   * decoded on this thread.
   */
  readonly isDecoded?: boolean;
}

/** Default of {@link PoolOptions.memoryBudget} in bytes, which suits phones. */
const DEFAULT_BUDGET = 256e6;

/** Translation of pages without one. */
const IN_PLACE: Vector3 = [0, 0, 0];

/** A page with assigned slots, and the progress of its upload. */
interface Upload {
  readonly page: number;
  readonly slots: readonly number[];
  /** Words of each slot. */
  readonly parts: readonly SlotWords[];
  /** Translation in world units. */
  readonly by: Vector3;
  /** Number of uploaded slots. */
  written: number;
}

function requireTime(arrivalMs: number): void {
  if (arrivalMs >= 0 && arrivalMs < Infinity) return;
  throw new GaussianSplatError('argument/value', {
    where: 'PoolOptions.arrivalMs',
    expected: 'milliseconds, 0 or more',
    found: String(arrivalMs),
    remedy: 'leave the option out for the default',
  });
}

/**
 * A scene of any size from static hosting. Only the pages that the view needs are on the GPU. The coarsest page is
 * always resident. For a missing page, its coarser parent is drawn.
 *
 * Draw the scene with the setting `detail` above 0 or with a `splatBudget`. Without either, every view requests the
 * finest pages.
 */
export class StreamedGaussians extends SceneBuffers {
  /** Sort order of splats in training: see `CloudHints.order`. */
  readonly order: TrainedOrder | undefined;
  readonly bounds: Bounds;
  readonly blocks: readonly GaussianBlock[];
  readonly detailBudget: DetailBudget;
  /** Page requests of the views, for the renderer. */
  readonly pageRequests: PageFeedback;
  readonly #source: PageSource;
  readonly #options: PoolOptions;
  readonly #pool: PagePool;
  readonly #residency: Residency;
  readonly #traffic: PageStreamer<readonly SlotWords[]>;
  readonly #uploadBudget = new UploadBudget();
  readonly #slotBytes: number;
  readonly #rows: TranslatedRows;
  readonly #arrivals: PageFadeIn;
  #upload: Upload | undefined;
  #isDestroyed = false;
  /** Whether {@link update} was called in the current task. */
  #isUpdated = false;
  #lacking = 0;
  #budgetError = 0;
  #uploaded = { blocks: 0, bytes: 0, milliseconds: 0 };
  #version = 1;

  private constructor(device: GPUDevice, memory: GpuMemory, source: PageSource, options: PoolOptions) {
    requireTime(options.arrivalMs ?? ARRIVAL_MS);
    const { scene, list } = source;
    const size = poolSize(scene, list, options.memoryBudget ?? DEFAULT_BUDGET);
    const { slots } = size;
    super(memory, scene, slots * SLOT_CHUNKS * constants.CULL_GROUP);
    memory.reserve('pages of a streamed scene', poolBytes(scene, size));
    ({ order: this.order, bounds: this.bounds } = scene);
    this.detailBudget = detailBudgetOn(device);
    this.#source = source;
    this.#options = options;
    this.#pool = new PagePool(device, memory, scene, size);
    this.pageRequests = new PageFeedback(device, memory, {
      pages: list.capacity ?? list.count,
      count: () => list.count,
      aheadMs: () => aheadMs(this.#traffic.arrivalMs),
      version: () => this.#version,
      onFeedback: (requests, lacking, budgetError) => this.#take(requests, lacking, budgetError),
      onStale: () => this.#options.onChange?.(),
    });
    this.blocks = this.#pool.pages;
    this.#residency = new Residency(list, slots, source.isCached);
    this.#slotBytes = slotBytes(scene);
    this.#traffic = new PageStreamer(this.#residency, {
      slotBytes: this.#slotBytes,
      fetch: async (page, signal) => {
        const words = await source.fetch(page, signal);
        signal.throwIfAborted();
        return words;
      },
      onArrival: () => this.#options.onChange?.(),
      onError: (error) => this.#options.onError?.(error),
    });
    this.#rows = new TranslatedRows(list, this.#residency, scene);
    this.#arrivals = new PageFadeIn(list, options.arrivalMs ?? ARRIVAL_MS, (page, arrived) =>
      this.#rows.setArrived(page, arrived),
    );
  }

  /**
   * Opens a streamed scene: allocates the pool, and fetches the coarsest page.
   * @param manifest Manifest that `checkManifest` returned.
   * @throws GaussianSplatError `out-of-memory/*` if memory is insufficient; errors of `fetchPage`; `decode/truncated`
   * for a page of the wrong length; `argument/value` for an invalid `arrivalMs`; the reason of `signal`.
   */
  static open(device: GPUDevice, manifest: DetailManifest, options: StreamOptions): Promise<StreamedGaussians> {
    return this.openSource(device, folderSource(manifest, options.fetchPage, options.isDecoded), options);
  }

  /**
   * Opens a streamed scene from any page source, as {@link open} does.
   * @throws GaussianSplatError `out-of-memory/*` if memory is insufficient; errors of the source for the first page;
   * `argument/value` and the reason of `signal` as {@link open} does.
   */
  static async openSource(device: GPUDevice, source: PageSource, options: PoolOptions): Promise<StreamedGaussians> {
    const what = `streamed scene of ${source.scene.splats} splats`;
    const scene = await withMemoryCheck(
      device,
      what,
      (memory) => new StreamedGaussians(device, memory, source, options),
    );
    try {
      const { signal = new AbortController().signal } = options;
      signal.throwIfAborted();
      scene.#residency.begin(0);
      const words = await source.fetch(0, signal);
      signal.throwIfAborted();
      if (scene.#begin(0, words)) while (scene.#upload) scene.#writeSlot(scene.#upload);
      scene.#finishWrites();
      return scene;
    } catch (error) {
      scene.destroy();
      options.signal?.throwIfAborted();
      throw error;
    }
  }

  /** Number of splats in the finest level, as far as it is known. */
  get leafCount(): number {
    return this.#source.scene.splats;
  }

  /** Incremented when a page arrives, fades in or is evicted. */
  get version(): number {
    return this.#version;
  }

  /** The pages on the GPU, from the last feedback pass, and what limits them. */
  get progress(): StreamProgress {
    const { slots, slotsInUse, chunks, lacksSlots } = this.#residency;
    return progressOf({
      resident: slots.count,
      total: this.#source.list.count,
      coming: this.#traffic.underWay + this.#placing,
      splats: chunks * constants.CULL_GROUP,
      bytes: slotsInUse * this.#slotBytes,
      error: this.#lacking,
      budgetError: this.#budgetError,
      lacksSlots,
    });
  }

  /**
   * Index of the page in each slot of the pool, through all files and instances of the manifest; undefined for an empty
   * slot.
   */
  get pagesInSlots(): readonly (number | undefined)[] {
    return Array.from(this.#residency.slots.pageIn, (page) => (page === NONE ? undefined : page));
  }

  /**
   * Totals since the scene was opened: number of uploaded pages and bytes, milliseconds of main-thread time, and the
   * number of pages that were fetched in vain because the view had changed.
   */
  get traffic(): {
    readonly blocks: number;
    readonly bytes: number;
    readonly milliseconds: number;
    readonly abandoned: number;
  } {
    return { ...this.#uploaded, abandoned: this.#traffic.abandoned };
  }

  /**
   * Uploads some of the received pages, and advances fades. The renderer calls this before each view. Only the first
   * call in a task has an effect, so that all views of a frame, such as two eyes, show the same pages.
   */
  update(): void {
    if (this.#isUpdated) return;
    this.#isUpdated = true;
    queueMicrotask(() => (this.#isUpdated = false));
    const start = performance.now();
    if (this.#arrivals.step(start)) this.#version++;
    this.#uploadSome(this.#uploadBudget.startFrame(start));
    this.#finishWrites();
    this.#uploaded.milliseconds += performance.now() - start;
    this.#traffic.sendForMore();
    if (this.#traffic.waiting + this.#placing > 0) queueMicrotask(() => this.#options.onChange?.());
  }

  override destroy(): void {
    this.#isDestroyed = true;
    this.#traffic.close();
    this.pageRequests.destroy();
    super.destroy();
  }

  /** Number of pages with assigned slots that are still uploading or fading in. */
  get #placing(): number {
    return (this.#upload ? 1 : 0) + this.#arrivals.count;
  }

  /** Uploads the most needed waiting pages: at least one slot, and more while they fit in `max` bytes. */
  #uploadSome(max: number): void {
    const start = performance.now();
    let bytes = 0;
    while (bytes === 0 || bytes + this.#slotBytes <= max) {
      if (this.#upload === undefined) {
        const next = this.#traffic.next();
        if (next === undefined) break;
        if (!this.#begin(next.page, next.words)) {
          this.#traffic.refused();
          // A page that found no slot counts as uploaded, because it used its part of the time budget.
          for (const { chunks } of next.words) bytes += this.#bytesOf(chunks);
          continue;
        }
      }
      bytes += this.#writeSlot(this.#upload!);
    }
    if (bytes > 0) this.#uploadBudget.note(bytes, performance.now() - start);
  }

  /**
   * Begins the upload of a page, and assigns slots to it. Pages evicted for it are replaced by their parents in this
   * frame. @returns False if there are no slots.
   */
  #begin(page: number, parts: readonly SlotWords[]): boolean {
    const place = this.#residency.settle(page);
    if (place === undefined) return false;
    for (const { page: evictee, slots } of place.left) {
      this.#arrivals.forget(evictee);
      this.#rows.leave(evictee, slots);
      this.#version++;
    }
    this.#upload = { page, slots: place.slots, parts, by: this.#source.translate?.(page) ?? IN_PLACE, written: 0 };
    return true;
  }

  /** Uploads one slot of a page; the last slot makes the page visible. @returns Number of uploaded bytes. */
  #writeSlot(upload: Upload): number {
    const { page, slots, parts, by } = upload;
    const words = parts[upload.written];
    const bytes = this.#bytesOf(words.chunks);
    this.#pool.write(slots[upload.written++], words, by);
    this.#uploaded.bytes += bytes;
    if (upload.written === parts.length) {
      this.#upload = undefined;
      this.#rows.load(page, parts, by);
      this.#arrivals.begin(page);
      this.#uploaded.blocks++;
      this.#version++;
    }
    return bytes;
  }

  #bytesOf(chunks: number): number {
    return (chunks * this.#slotBytes) / SLOT_CHUNKS;
  }

  #finishWrites(): void {
    this.#rows.flush(this.#pool.slotsPerBuffer, (first, rows) => this.#pool.writeDetails(first, rows));
    this.#pool.flush();
  }

  #take(requests: Float32Array, lacking: number, budgetError: number): void {
    if (this.#isDestroyed) return;
    this.#lacking = lacking;
    this.#budgetError = budgetError;
    this.#residency.note(requests);
    this.#traffic.follow();
  }
}
