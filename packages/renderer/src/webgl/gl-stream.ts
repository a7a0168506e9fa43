/** Pages of a streamed scene in the textures of WebGL, chosen on the CPU. */
import { GaussianSplatError, type Camera, type Vector3 } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import { aheadMs, CameraMotion } from '../streaming/camera-motion.js';
import { exactGeometry } from '../streaming/exact-slot.js';
import { SLOT_CHUNKS } from '../streaming/manifest.js';
import { ARRIVED } from '../streaming/page-rows.js';
import type { PageSource } from '../streaming/page-source.js';
import { PageStreamer } from '../streaming/page-streamer.js';
import { EXACT, PageUnpacker, UNPACKED_AT_ONCE, type UnpackedPage } from '../streaming/page-unpacker.js';
import { turn } from '../gpu/page-thread.js';
import { progressOf, type StreamProgress } from '../streaming/progress.js';
import { Residency } from '../streaming/residency.js';
import { chunkLayout, startOf, type SlotWords } from '../streaming/slot-words.js';
import { TranslatedRows } from '../streaming/translated-rows.js';
import { GEOMETRY_WORDS } from '../pack/words.js';
import { GlGaussians, positionsIn, type RunGl } from './gl-gaussians.js';
import { pageRequests } from './page-requests.js';
import type { SplatUpdate } from './splat-order.js';

const { CULL_GROUP } = constants;
const SLOT_SPLATS = SLOT_CHUNKS * CULL_GROUP;
const DEFAULT_SPLATS = 1_000_000;
/** Milliseconds between two requests for pages while the camera moves. */
const REQUEST_MS = 50;
const IN_PLACE: Vector3 = [0, 0, 0];

export interface GlStreamOptions {
  /** Maximum number of splats on the GPU, of all levels. Default: one million. */
  readonly maxSplats?: number;
  /** Cancels the opening of the scene. Has no effect once it is open. */
  readonly signal?: AbortSignal;
  /** Called when another frame is required, because a page has arrived. */
  readonly onChange?: () => void;
  /** Called at the first failure of a page; its parent stays visible. It is requested again later. */
  readonly onError?: (error: unknown) => void;
}

/** Splats of a slot in the layout of the textures. */
interface SlotSplats {
  readonly geometry: Uint32Array<ArrayBuffer>;
  readonly sh: Uint32Array;
}

/** Splats of a slot that wait for the order that contains them. */
interface Write extends SlotSplats {
  readonly first: number;
}

/**
 * The resident pages of a scene. Their number of splats is fixed, so that memory and the time of a sort are bounded; within
 * it the pages with the largest errors in pixels are resident. A page becomes visible with the next order of the splats.
 */
export class GlStream {
  readonly gaussians: GlGaussians;
  readonly #source: PageSource;
  readonly #residency: Residency;
  readonly #traffic: PageStreamer<readonly SlotWords[]>;
  readonly #unpacker: PageUnpacker<SlotSplats>;
  readonly #rows: TranslatedRows;
  /** [C, 12] levels of all chunks, as the sorter has them. */
  readonly #details: Float32Array<ArrayBuffer>;
  readonly #motion = new CameraMotion();
  #writes: Write[] = [];
  #requestedAt = -Infinity;
  /** Largest error in pixels of a missing page in the last view. */
  #lacking = 0;

  private constructor(
    gl: WebGL2RenderingContext,
    source: PageSource,
    { onChange, onError, maxSplats = DEFAULT_SPLATS }: GlStreamOptions,
    run: RunGl,
  ) {
    const { scene, list } = source;
    const all = list.maxSlots ?? list.slots.reduce((sum, slots) => sum + slots, 0);
    const slots = Math.min(all, Math.floor(maxSplats / SLOT_SPLATS));
    if (slots < list.slots[0]) throw tooFew(SLOT_SPLATS * list.slots[0], maxSplats);
    this.#source = source;
    this.gaussians = run(() => new GlGaussians(gl, { ...scene, count: SLOT_SPLATS * slots, droppedCount: 0 }));
    this.#residency = new Residency(list, slots, source.isCached);
    this.#traffic = new PageStreamer(this.#residency, {
      slotBytes: 4 * SLOT_CHUNKS * chunkLayout(scene).total,
      fetch: source.fetch,
      onArrival: () => onChange?.(),
      onError: (reason) => onError?.(reason),
    });
    this.#unpacker = new PageUnpacker(() => this.#traffic.next(), this.#unpack, scene.geometry ? 1 : EXACT);
    this.#rows = new TranslatedRows(list, this.#residency, scene);
    this.#details = new Float32Array(DETAIL_NUMBERS * SLOT_CHUNKS * slots);
  }

  /** Allocates textures, and fetches the coarsest page. Rejects as `GlHost.stream` does. */
  static async open(
    gl: WebGL2RenderingContext,
    source: PageSource,
    options: GlStreamOptions,
    run: RunGl,
  ): Promise<GlStream> {
    const { signal = new AbortController().signal } = options;
    signal.throwIfAborted();
    const stream = new GlStream(gl, source, options, run);
    try {
      stream.#residency.begin(0);
      const words = await source.fetch(0, signal);
      signal.throwIfAborted();
      const parts: SlotSplats[] = [];
      for (const [k, slot] of words.entries()) {
        if (k > 0 && k % UNPACKED_AT_ONCE === 0) await turn();
        parts.push(stream.#unpack(slot, 0));
      }
      signal.throwIfAborted();
      stream.#settle({ page: 0, words, parts });
      return stream;
    } catch (reason) {
      stream.destroy();
      throw reason;
    }
  }

  /** Number of splats for which there is memory. */
  get count(): number {
    return this.gaussians.facts.count;
  }

  /** Whether there are pages that the next order can contain. */
  get hasNews(): boolean {
    return this.#writes.length > 0 || this.#unpacker.hasReady;
  }

  /** Whether pages have arrived that no order contains yet. */
  get isBehind(): boolean {
    return this.hasNews || this.#unpacker.count + this.#traffic.waiting > 0;
  }

  /** The pages on the GPU, from the last request for pages, and what limits them. */
  get progress(): StreamProgress {
    const { slots, slotsInUse, chunks, lacksSlots } = this.#residency;
    const { facts } = this.gaussians;
    const slotBytes = 4 * (chunkLayout({ ...facts, geometry: undefined }).total * SLOT_CHUNKS);
    return progressOf({
      ...{
        resident: slots.count,
        total: this.#source.list.count,
        coming: this.#traffic.underWay + this.#unpacker.count,
      },
      ...{ splats: chunks * CULL_GROUP, bytes: slotsInUse * slotBytes, error: this.#lacking, lacksSlots },
      budgetError: 0,
    });
  }

  /**
   * Requests the pages that a view needs, now or soon, and unpacks some that have arrived. Call this once in a frame.
   * @param allowed Maximum error, pixels.
   */
  follow(camera: Camera, allowed: number): void {
    this.#unpacker.step();
    const now = performance.now();
    this.#motion.observe(camera, now);
    if (now - this.#requestedAt < REQUEST_MS) return;
    this.#requestedAt = now;
    const later = this.#motion.ahead(aheadMs(this.#traffic.arrivalMs));
    const pages = {
      list: this.#source.list,
      slots: this.#residency.slots,
      details: this.#details,
      origin: this.gaussians.facts.origin,
    };
    const requests = pageRequests(pages, later === camera ? [camera] : [camera, later], allowed);
    this.#lacking = requests[0];
    this.#residency.note(requests);
    this.#traffic.follow();
  }

  /** Adds the unpacked pages, and returns what has changed for the sorter. Call {@link write} with its order. */
  take(): SplatUpdate {
    for (const page of this.#unpacker.take()) if (!this.#settle(page)) this.#traffic.refused();
    this.#traffic.sendForMore();
    const details: SplatUpdate['details'][number][] = [];
    this.#rows.flush(this.#residency.slots.pageIn.length, (slot, rows) => {
      const at = DETAIL_NUMBERS * SLOT_CHUNKS * slot;
      this.#details.set(rows, at);
      details.push({ at, numbers: rows.slice() });
    });
    const positions = this.#writes.map(({ first, geometry }) => ({ at: 3 * first, numbers: positionsIn(geometry) }));
    return { positions, details };
  }

  /**
   * Uploads the splats of the last {@link take}: consecutive slots at once, because a call costs as much as thousands of
   * splats. @returns Whether there were any.
   */
  write(): boolean {
    const writes = this.#writes.sort((a, b) => a.first - b.first);
    this.#writes = [];
    const full = SLOT_CHUNKS * chunkLayout(this.#source.scene).sh;
    for (let from = 0, to = 1; from < writes.length; from = to++) {
      const isNext = (k: number): boolean =>
        writes[k]?.first === writes[k - 1].first + SLOT_SPLATS && writes[k - 1].sh.length === full;
      while (isNext(to)) to++;
      const run = writes.slice(from, to);
      const [geometry, sh] = (['geometry', 'sh'] as const).map((part) =>
        concatenated(
          Uint32Array,
          run.map((slot) => slot[part]),
        ),
      );
      this.gaussians.write(run[0].first, geometry, sh);
    }
    return writes.length > 0;
  }

  destroy(): void {
    this.#traffic.close();
    this.gaussians.destroy();
  }

  /** Makes a page resident. @returns False if there are no slots for it. */
  #settle({ page, words, parts }: UnpackedPage<SlotSplats>): boolean {
    const place = this.#residency.settle(page);
    if (place === undefined) return false;
    const by = this.#translation(page);
    for (const evicted of place.left) this.#rows.leave(evicted.page, evicted.slots);
    this.#rows.load(page, words, by);
    this.#rows.setArrived(page, ARRIVED);
    parts.forEach((part, k) => this.#writes.push({ ...part, first: SLOT_SPLATS * place.slots[k] }));
    return true;
  }

  readonly #unpack = (words: SlotWords, page: number): SlotSplats => {
    const { scene } = this.#source;
    const layout = chunkLayout(scene);
    const geometry = new Uint32Array(GEOMETRY_WORDS * SLOT_SPLATS);
    const own = exactGeometry(words, scene, layout, this.#translation(page));
    geometry.set(own);
    // A part of a slot without splats is not listed.
    new Float32Array(geometry.buffer).fill(NaN, own.length);
    const at = startOf(words, 'sh', layout);
    return { geometry, sh: words.words.subarray(at, at + layout.sh * words.chunks) };
  };

  #translation(page: number): Vector3 {
    return this.#source.translate?.(page) ?? IN_PLACE;
  }
}

const tooFew = (needed: number, found: number): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where: 'GlHost.stream(): maxSplats',
    expected: `at least ${needed} for the coarsest page`,
    found: String(found),
    remedy: 'raise maxSplats',
  });
