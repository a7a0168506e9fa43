import { DATA_WIDTH, SplatOrder, type OrderView } from '@gaussian-splat/renderer/webgl';
import type { PageMessage, WorkerMessage } from '../loading/protocol.js';
import type { SortAnswer, SortRequest } from '../loading/sort-splats.js';

/** How long an order may be waited for, ms: a worker that has not begun by then may never do. */
const LATE_MS = 2_000;

/** An order, and the view that it is of. */
export interface SortedSplats {
  readonly view: OrderView;
  /** Numbers of splats from near to far, in whole rows of `DATA_WIDTH`. */
  readonly order: Uint32Array;
  readonly count: number;
}

export interface DepthSorterOptions {
  /** [N, 3] relative to the scene's origin */
  readonly positions: Float32Array;
  readonly spawn: () => Worker;
  /** Gets each order as it comes; its buffer is only lent. */
  readonly onOrder: (sorted: SortedSplats) => void;
}

/**
 * Has a worker sort splats, one view at a time: of those that are asked for meanwhile the latest is next. Where the page refuses the worker, or that does not
 * answer, the page's own thread sorts.
 */
export class DepthSorter {
  readonly #options: DepthSorterOptions;
  readonly #worker: Worker | undefined;
  #port: MessagePort | undefined;
  #here: SplatOrder | undefined;
  /** Lent to the worker while it sorts. */
  #buffer: Uint32Array<ArrayBuffer>;
  #isSorting = false;
  #next: OrderView | undefined;
  #late: ReturnType<typeof setTimeout> | undefined;

  constructor(options: DepthSorterOptions) {
    this.#options = options;
    this.#buffer = this.#makeBuffer();
    this.#worker = this.#start();
    this.#late = setTimeout(this.#giveUp, LATE_MS);
  }

  /** Asks for the order of a view. */
  request(view: OrderView): void {
    this.#next = view;
    this.#proceed();
  }

  /** The order of a view, at once. */
  sortNow(view: OrderView): SortedSplats {
    this.#here ??= new SplatOrder(this.#options.positions);
    // Its own buffer may be away.
    const order = this.#buffer.length > 0 ? this.#buffer : this.#makeBuffer();
    return { view, order, count: this.#here.sort(view, order) };
  }

  destroy(): void {
    clearTimeout(this.#late);
    this.#next = undefined;
    this.#port?.close();
    this.#port = undefined;
    this.#worker?.terminate();
  }

  #makeBuffer(): Uint32Array<ArrayBuffer> {
    const count = this.#options.positions.length / 3;
    return new Uint32Array(Math.max(1, Math.ceil(count / DATA_WIDTH)) * DATA_WIDTH);
  }

  #start(): Worker | undefined {
    try {
      const worker = this.#options.spawn();
      worker.addEventListener('message', ({ data }: MessageEvent<WorkerMessage>) => {
        if (data.type === 'ready' && this.#late !== undefined) this.#connect(worker);
      });
      worker.addEventListener('error', (event) => {
        event.preventDefault();
        this.#giveUp();
      });
      return worker;
    } catch {
      queueMicrotask(this.#giveUp);
      return undefined;
    }
  }

  #connect(worker: Worker): void {
    const { port1, port2 } = new MessageChannel();
    const { positions } = this.#options;
    worker.postMessage({ type: 'sort', port: port2, positions } satisfies PageMessage, [port2]);
    port1.onmessage = ({ data }: MessageEvent<SortAnswer>) => this.#take(data);
    this.#port = port1;
    this.#proceed();
  }

  #proceed(): void {
    const view = this.#next;
    if (view === undefined || this.#isSorting) return;
    if (this.#port === undefined) {
      // Until the worker is there, or never will be.
      if (this.#late === undefined) setTimeout(this.#sortHere);
      return;
    }
    this.#next = undefined;
    this.#isSorting = true;
    const buffer = this.#buffer;
    this.#buffer = new Uint32Array(0);
    this.#port.postMessage({ view, order: buffer } satisfies SortRequest, [buffer.buffer]);
  }

  #take({ view, order, count }: SortAnswer): void {
    clearTimeout(this.#late);
    this.#isSorting = false;
    this.#buffer = order;
    this.#options.onOrder({ view, order, count });
    this.#proceed();
  }

  readonly #sortHere = (): void => {
    const view = this.#next;
    this.#next = undefined;
    if (view !== undefined) this.#options.onOrder(this.sortNow(view));
  };

  /** No worker answers: the page's thread sorts from now on. */
  readonly #giveUp = (): void => {
    clearTimeout(this.#late);
    this.#late = undefined;
    this.#port?.close();
    this.#port = undefined;
    this.#worker?.terminate();
    if (this.#isSorting) this.#buffer = this.#makeBuffer();
    this.#isSorting = false;
    this.#proceed();
  };
}
