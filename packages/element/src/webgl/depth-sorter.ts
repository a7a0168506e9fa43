import { DATA_WIDTH, SplatOrder, type OrderView } from '@gaussian-splat/renderer/webgl';
import type { PageMessage, WorkerMessage } from '../loading/worker-messages.js';
import type { SortAnswer, SortRequest } from '../loading/sort-splats.js';

/**
 * Maximum milliseconds from the first request to the first order. A worker that has not started by then may never
 * start.
 */
const LATE_MS = 2_000;

/** The one worker that sorts for all scenes of a page. */
class SortWorker {
  static #current: SortWorker | undefined;
  /** Fulfills when the worker has started. Rejects if the page cannot create a worker. */
  readonly ready: Promise<Worker>;
  readonly #spawn: () => Worker;
  #worker: Worker | undefined;
  /** Callbacks of the sorters in use, called if the worker fails. */
  readonly #users = new Set<() => void>();

  private constructor(spawn: () => Worker) {
    this.#spawn = spawn;
    this.ready = new Promise((resolve) => {
      const worker = (this.#worker = spawn());
      worker.addEventListener('message', ({ data }: MessageEvent<WorkerMessage>) => {
        if (data.type === 'ready') resolve(worker);
      });
      worker.addEventListener('error', (event) => {
        event.preventDefault();
        this.#end();
        for (const onEnd of this.#users) onEnd();
      });
    });
  }

  static acquire(spawn: () => Worker, onEnd: () => void): SortWorker {
    const known = this.#current;
    const worker = known && known.#spawn === spawn ? known : new SortWorker(spawn);
    this.#current = worker;
    worker.#users.add(onEnd);
    return worker;
  }

  release(onEnd: () => void): void {
    this.#users.delete(onEnd);
    if (this.#users.size === 0) this.#end();
  }

  #end(): void {
    if (SortWorker.#current === this) SortWorker.#current = undefined;
    this.#worker?.terminate();
  }
}

/** A requested view, and the time of the request by `performance.now`. */
interface Asked {
  readonly view: OrderView;
  readonly askedAt: number;
}

/** An order of splats, and the view that it was sorted for. */
export interface SortedSplats extends Asked {
  /** Indices of splats from near to far, in complete rows of `DATA_WIDTH`. */
  readonly order: Uint32Array;
  readonly count: number;
  /** Average number of splats that cover a pixel. */
  readonly covered: number;
}

export interface DepthSorterOptions {
  /** [N, 3] positions relative to the scene's origin. */
  readonly positions: Float32Array;
  /** [N] area of each splat's largest cross-section. */
  readonly areas?: Float32Array | undefined;
  readonly spawn: () => Worker;
  /** Called with each order. Its buffer is reused after the call. */
  readonly onOrder: (sorted: SortedSplats) => void;
}

/**
 * Sorts splats in a worker, one view at a time. Among the requests made meanwhile, only the latest is sorted next. If
 * the page forbids the worker, or it does not answer, the main thread sorts.
 */
export class DepthSorter {
  readonly #options: DepthSorterOptions;
  readonly #worker: SortWorker;
  #port: MessagePort | undefined;
  #here: SplatOrder | undefined;
  /** Buffer of the order; empty while the worker has it. */
  #buffer: Uint32Array<ArrayBuffer>;
  #sorting: Asked | undefined;
  #next: Asked | undefined;
  #isHere = false;
  #isOver = false;
  /** Timer that starts with the first request, because a hidden page requests no order. */
  #late: ReturnType<typeof setTimeout> | undefined;
  /** Duration of the worker's last sort, milliseconds; Infinity before the first. */
  milliseconds = Infinity;

  constructor(options: DepthSorterOptions) {
    this.#options = options;
    this.#buffer = this.#makeBuffer();
    this.#worker = SortWorker.acquire(options.spawn, this.#giveUp);
    this.#worker.ready.then((worker) => this.#connect(worker), this.#giveUp);
  }

  /** Requests the order of a view. `onOrder` receives it later. */
  request(view: OrderView): void {
    this.#late ??= setTimeout(this.#giveUp, LATE_MS);
    this.#next = { view, askedAt: performance.now() };
    this.#proceed();
  }

  /** Sorts on the main thread and returns the order of a view. Its buffer is reused after the next request. */
  sortNow(view: OrderView): SortedSplats {
    const here = (this.#here ??= new SplatOrder(this.#options.positions, this.#options.areas));
    // The worker may have the buffer.
    const order = this.#buffer.length > 0 ? this.#buffer : this.#makeBuffer();
    const askedAt = performance.now();
    const count = here.sort(view, order);
    return { view, askedAt, order, count, covered: here.covered };
  }

  destroy(): void {
    if (this.#isOver) return;
    this.#isOver = true;
    clearTimeout(this.#late);
    this.#next = undefined;
    this.#port?.close();
    this.#worker.release(this.#giveUp);
  }

  #makeBuffer(): Uint32Array<ArrayBuffer> {
    const count = this.#options.positions.length / 3;
    return new Uint32Array(Math.max(1, Math.ceil(count / DATA_WIDTH)) * DATA_WIDTH);
  }

  #connect(worker: Worker): void {
    if (this.#isOver || this.#isHere) return;
    const { port1, port2 } = new MessageChannel();
    const { positions, areas } = this.#options;
    worker.postMessage({ type: 'sort', port: port2, positions, areas } satisfies PageMessage, [port2]);
    port1.onmessage = ({ data }: MessageEvent<SortAnswer>) => this.#take(data);
    this.#port = port1;
    this.#proceed();
  }

  #proceed(): void {
    const next = this.#next;
    if (next === undefined || this.#sorting !== undefined) return;
    if (this.#isHere) return void setTimeout(this.#sortHere);
    // Without a port, the worker has not started yet. The request is sent after its start.
    if (this.#port === undefined) return;
    this.#next = undefined;
    this.#sorting = next;
    const order = this.#buffer;
    this.#buffer = new Uint32Array(0);
    this.#port.postMessage({ view: next.view, order } satisfies SortRequest, [order.buffer]);
  }

  #take({ view, order, count, covered, milliseconds }: SortAnswer): void {
    if (this.#isHere || this.#isOver) return;
    this.milliseconds = milliseconds;
    clearTimeout(this.#late);
    const { askedAt = 0 } = this.#sorting ?? {};
    this.#sorting = undefined;
    this.#buffer = order;
    this.#options.onOrder({ view, askedAt, order, count, covered });
    this.#proceed();
  }

  readonly #sortHere = (): void => {
    const next = this.#next;
    this.#next = undefined;
    if (next !== undefined) this.#options.onOrder(this.sortNow(next.view));
  };

  /** Makes the main thread sort from this call on, because no worker answers. */
  readonly #giveUp = (): void => {
    if (this.#isOver || this.#isHere) return;
    this.#isHere = true;
    clearTimeout(this.#late);
    this.#port?.close();
    this.#next ??= this.#sorting;
    this.#sorting = undefined;
    if (this.#buffer.length === 0) this.#buffer = this.#makeBuffer();
    this.#proceed();
  };
}
