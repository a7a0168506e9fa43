/**
 * Maximum number of runs that the GPU may not have finished when another one starts: one executes while the next is
 * encoded.
 */
const MAX_IN_FLIGHT = 2;
/** A run that keeps the GPU for longer than this, ms, is awaited, because frames queue behind it. */
const SLOW_RUN_MS = 50;

export interface RunLoopOptions<RunRequest> {
  readonly queue: GPUQueue;
  /** Whether a request requires a run. */
  readonly isDue: (request: RunRequest) => boolean;
  /** Resolves once the work is submitted. */
  readonly run: (request: RunRequest) => Promise<void>;
  readonly onError: (error: unknown) => void;
}

/** Runs the latest request, as fast as runs finish and never faster: neither calls nor GPU work queue up. */
export class RunLoop<RunRequest> {
  readonly #options: RunLoopOptions<RunRequest>;
  readonly #unfinished: Promise<unknown>[] = [];
  #request: RunRequest | undefined;
  #running: Promise<void> | undefined;
  #milliseconds: number | undefined;
  #isSlow = false;
  #isClosed = false;

  constructor(options: RunLoopOptions<RunRequest>) {
    this.#options = options;
  }

  get isClosed(): boolean {
    return this.#isClosed;
  }

  get isBusy(): boolean {
    return this.#running !== undefined;
  }

  /** From the start of the last finished run until the GPU had finished it, ms. */
  get milliseconds(): number | undefined {
    return this.#milliseconds;
  }

  /** Resolves, and never rejects, when no run is in progress. */
  get idle(): Promise<void> {
    return this.#running ?? Promise.resolve();
  }

  /** Returns at once; a request that has not started yet is replaced. */
  request(request: RunRequest): void {
    if (this.#isClosed) return;
    this.#request = request;
    this.#running ??= this.#work();
  }

  close(): void {
    this.#isClosed = true;
    this.#request = undefined;
  }

  async #work(): Promise<void> {
    // Merges the requests of one task.
    await Promise.resolve();
    try {
      for (let request = this.#take(); request !== undefined; request = this.#take()) {
        try {
          await this.#run(request);
        } catch (error) {
          if (!this.#isClosed) this.#options.onError(error);
        }
      }
    } finally {
      // Set synchronously: a request one microtask later needs a new loop.
      this.#running = undefined;
    }
  }

  #take(): RunRequest | undefined {
    const request = this.#request;
    this.#request = undefined;
    return request !== undefined && !this.#isClosed && this.#options.isDue(request) ? request : undefined;
  }

  async #run(request: RunRequest): Promise<void> {
    const start = performance.now();
    await this.#options.run(request);
    if (!this.#isClosed) await this.#waitForRoom(start);
  }

  /** A lost device never finishes, and is reported by other code. */
  async #waitForRoom(start: number): Promise<void> {
    const submitted = performance.now();
    const finished = this.#options.queue.onSubmittedWorkDone().then(
      () => {
        const now = performance.now();
        this.#milliseconds = now - start;
        this.#isSlow = now - submitted > SLOW_RUN_MS;
      },
      () => undefined,
    );
    this.#unfinished.push(finished);
    while (this.#unfinished.length >= (this.#isSlow ? 1 : MAX_IN_FLIGHT)) await this.#unfinished.shift();
  }
}
