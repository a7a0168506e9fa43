/**
 * Maximum number of runs that the GPU has not finished, including the next one: one executes while the other is
 * encoded.
 */
const MAX_IN_FLIGHT = 2;
/**
 * GPU time of a run, milliseconds, above which the loop waits for the run to finish, because frames would be delayed by
 * further runs.
 */
const SLOW_RUN_MS = 50;

export interface RunLoopOptions<RunRequest> {
  readonly queue: GPUQueue;
  /** Whether a request requires a run. False, for example, if its inputs equal those of the last run. */
  readonly isDue: (request: RunRequest) => boolean;
  /** Executes a run. Fulfills when its GPU work is submitted. */
  readonly run: (request: RunRequest) => Promise<void>;
  readonly onError: (error: unknown) => void;
}

/**
 * Runs the latest request when the previous run is submitted and the GPU is not behind, so that neither calls nor GPU
 * work accumulate.
 */
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

  /** Milliseconds from the start of the last finished run until the GPU had finished it; undefined before the first. */
  get milliseconds(): number | undefined {
    return this.#milliseconds;
  }

  /** Fulfills when no run is in progress. Never rejects. */
  get idle(): Promise<void> {
    return this.#running ?? Promise.resolve();
  }

  /** Requests a run and returns at once. Replaces a request that has not started yet. */
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
    // Waits for a microtask, so that of several synchronous requests only the last one runs.
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
      // Reset synchronously, because a request one microtask later needs a new loop.
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

  /** Waits until the GPU can take another run. A lost device ends the wait; other code reports the loss. */
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
