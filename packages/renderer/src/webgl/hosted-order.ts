import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES, ENDLESS } from '../levels/chunk-detail.js';
import type { PackedGaussians } from '../pack/pack.js';
import { positionsIn } from './gl-gaussians.js';
import type { GlStream } from './gl-stream.js';
import { DATA_WIDTH } from './shaders.js';
import type { SortAnswer, SortRequest } from './sort-splats.js';
import { isSameView, SplatOrder, type OrderView } from './splat-order.js';

/** Sorts that take more than these milliseconds do not run for each frame. They use at most this fraction of the time. */
const [QUICK_SORT_MS, SORT_SHARE] = [8, 0.25];
const { CULL_GROUP } = constants;
const NO_ORDER = new Uint32Array(0);

/** Splats to sort: [N, 3] positions, and [N / 256, 12] levels of detail, undefined without levels. */
export interface SortedRows {
  readonly positions: Float32Array<ArrayBuffer>;
  readonly details: Float32Array<ArrayBuffer> | undefined;
}

/** The order of a host's splats, sorted on the main thread or in a worker of the page. */
export class HostedOrder {
  readonly #here: SplatOrder | undefined;
  readonly #port: MessagePort | undefined;
  readonly #stream: GlStream | undefined;
  /** Empty while the worker has it. */
  #order: Uint32Array<ArrayBuffer>;
  /** Number of splats in an order of the worker that the next frame uploads: a task of its own would wait for the GPU process. */
  #arrived: number | undefined;
  #sorted: readonly OrderView[] | undefined;
  #sortedAt = -Infinity;
  #sortMs = 0;

  /**
   * @param rows Splats of all scenes. A worker receives their memory.
   * @param stream Brings changes of the rows.
   */
  constructor({ positions, details }: SortedRows, worker?: Worker, stream?: GlStream) {
    this.#stream = stream;
    this.#order = new Uint32Array(DATA_WIDTH * Math.max(1, Math.ceil(positions.length / 3 / DATA_WIDTH)));
    if (!worker) {
      this.#here = new SplatOrder(positions);
      this.#here.details = details;
      return;
    }
    const { port1, port2 } = new MessageChannel();
    worker.postMessage({ port: port2, positions }, [port2, positions.buffer]);
    if (details) port1.postMessage({ details }, [details.buffer]);
    port1.onmessage = ({ data: { view, order, count } }: MessageEvent<SortAnswer<readonly OrderView[]>>) => {
      this.#order = order;
      this.#arrived = count;
      this.#sorted = view;
    };
    this.#port = port1;
  }

  /**
   * Sorts for the view of each scene, or asks the worker to.
   * @param upload Called with a new order of `count` splats, which is reused later.
   * @returns Whether the last uploaded order is that of these views, with all pages that have arrived.
   */
  update(views: readonly OrderView[], upload: (order: Uint32Array, count: number) => void): boolean {
    if (this.#arrived !== undefined) upload(this.#order, this.#arrived);
    this.#arrived = undefined;
    const stream = this.#stream;
    if (!stream?.hasNews && this.#sorted?.every((old, k) => isSameView(views[k], old))) return !stream?.isBehind;
    if (!this.#here) return this.#ask(views);
    const begin = performance.now();
    if (this.#sortMs > QUICK_SORT_MS && begin - this.#sortedAt < this.#sortMs / SORT_SHARE) return false;
    if (stream) this.#here.replace(stream.take());
    const count = this.#here.sort(views, this.#order);
    this.#sorted = views;
    this.#sortedAt = performance.now();
    this.#sortMs = this.#sortedAt - begin;
    upload(this.#order, count);
    return true;
  }

  #ask(view: readonly OrderView[]): false {
    const order = this.#order;
    if (order.length === 0) return false;
    this.#order = NO_ORDER;
    const update = this.#stream?.take();
    const moved = update ? [...update.positions, ...update.details].map(({ numbers }) => numbers.buffer) : [];
    const request: SortRequest<readonly OrderView[]> = { view, order, update };
    this.#port?.postMessage(request, [order.buffer, ...moved]);
    return false;
  }

  destroy(): void {
    this.#port?.close();
  }
}

/** Returns the positions and levels of all splats. Indices between scenes have the position NaN, which is not listed. */
export function joinedRows(all: readonly PackedGaussians[], first: readonly number[], count: number): SortedRows {
  const positions = new Float32Array(3 * count).fill(NaN);
  for (const [k, { geometry }] of all.entries()) positions.set(positionsIn(geometry), 3 * first[k]);
  if (!all.some(({ details }) => details)) return { positions, details: undefined };
  const details = new Float32Array(DETAIL_NUMBERS * (count / CULL_GROUP));
  // Chunks of a scene without levels are the finest, and have no parent.
  for (let at = DETAIL_PLACES.parentError; at < details.length; at += DETAIL_NUMBERS) details[at] = ENDLESS;
  for (const [k, { details: own }] of all.entries())
    if (own) details.set(own, DETAIL_NUMBERS * (first[k] / CULL_GROUP));
  return { positions, details };
}
