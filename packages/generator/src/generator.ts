import { sameInputs, type InputValue } from './bind-inputs.js';
import type { GeneratorSession } from './runtime/generator-session.js';
import type { RunOutputs } from './runtime/live-session.js';
import { acquireSession, type AcquireOptions, type SessionLease } from './runtime/shared-sessions.js';
import type { ModelSource } from './runtime/open-model.js';
import type { GeneratorState } from './state.js';

/** Takes what runs write: `DynamicGaussians` of the renderer is one. It must submit its work before it returns. */
export interface GaussianSink {
  ingest(tensors: RunOutputs['tensors'], rows: number): void;
}

/** A run whose Gaussians have reached the sink. */
export interface GeneratedFrame {
  /** The state that it shows. */
  readonly state: GeneratorState;
  /** From the start of the run until its work was submitted, ms; the GPU may still be at it. */
  readonly milliseconds: number;
}

export interface GeneratorOptions extends AcquireOptions {
  readonly onFrame?: (frame: GeneratedFrame) => void;
  /** A run failed; what was shown before stays. The next request tries again. */
  readonly onError?: (error: unknown) => void;
}

/** Runs whose work the GPU may not have finished before another one starts: one is computed while the next is recorded. */
const MAX_IN_FLIGHT = 2;
/** A run that keeps the GPU for longer than this, ms, is waited for: frames that are drawn meanwhile stand behind it in the queue. */
const SLOW_RUN_MS = 50;

interface Wish {
  readonly state: GeneratorState;
  readonly inputs: Readonly<Record<string, InputValue>>;
}

/**
 * One instance of a generator: runs it for the latest state asked for, as fast as runs finish and never faster.
 *
 * ```ts
 * const generator = await Generator.open({ url: 'walker.onnx' }, device, { onFrame: requestDraw });
 * generator.sink = await DynamicGaussians.create(device, generator.model.layout);
 * generator.request({ camera, timeSeconds }); // as often as you like
 * ```
 */
export class Generator {
  /** Where runs go; without one there are no runs. */
  sink: GaussianSink | undefined;
  readonly #lease: SessionLease;
  readonly #options: GeneratorOptions;
  readonly #unfinished: Promise<unknown>[] = [];
  #wish: Wish | undefined;
  #shown: Wish['inputs'] | undefined;
  #running: Promise<void> | undefined;
  #runs = 0;
  #isSlow = false;
  #isClosed = false;

  private constructor(lease: SessionLease, options: GeneratorOptions) {
    this.#lease = lease;
    this.#options = options;
  }

  /**
   * Fetches a generator and checks it; not a byte of the runtime is fetched yet.
   * @throws ContractError, GaussianSplatError: see `openModel`.
   */
  static async open(source: ModelSource, device: GPUDevice, options: GeneratorOptions = {}): Promise<Generator> {
    return new Generator(await acquireSession(source, device, options), options);
  }

  get model(): GeneratorSession['model'] {
    return this.#lease.session.model;
  }

  /** How it runs; undefined before the first run. */
  get kind(): GeneratorSession['kind'] {
    return this.#lease.session.kind;
  }

  /** Runs that have reached the sink. */
  get runs(): number {
    return this.#runs;
  }

  /** Fulfils, and never rejects, when no run is on its way. */
  get idle(): Promise<void> {
    return this.#running ?? Promise.resolve();
  }

  /**
   * Asks for the Gaussians of a state. Returns at once; a request that has not started yet is replaced, and a state whose inputs are
   * those on show is not run at all.
   * @throws GaussianSplatError `argument/value` if the state does not fit the contract.
   */
  request(state: GeneratorState): void {
    if (this.#isClosed) return;
    this.#wish = { state, inputs: this.#lease.session.bind(state) };
    this.#running ??= this.#work().finally(() => (this.#running = undefined));
  }

  /** Ends it: a run on its way reaches nobody any more. */
  close(): void {
    this.#isClosed = true;
    this.#wish = undefined;
    this.#lease.release();
  }

  async #work(): Promise<void> {
    // So that requests of the same task are one.
    await Promise.resolve();
    for (let wish = this.#take(); wish !== undefined; wish = this.#take()) {
      try {
        await this.#run(wish);
      } catch (error) {
        if (!this.#isClosed) this.#options.onError?.(error);
      }
    }
  }

  /** The latest wish, unless it is on show. */
  #take(): Wish | undefined {
    const wish = this.#wish;
    this.#wish = undefined;
    if (wish === undefined || this.sink === undefined || this.#isClosed) return undefined;
    return this.#shown && sameInputs(wish.inputs, this.#shown) ? undefined : wish;
  }

  async #run({ state, inputs }: Wish): Promise<void> {
    const start = performance.now();
    const { session } = this.#lease;
    await session.run(inputs, ({ tensors, rows }) => {
      if (this.#isClosed) return;
      this.sink?.ingest(tensors, rows);
      this.#shown = inputs;
      this.#runs++;
    });
    if (this.#isClosed) return;
    this.#options.onFrame?.({ state, milliseconds: performance.now() - start });
    await this.#waitForRoom(session.device.queue);
  }

  /** Never a backlog on the GPU either. A lost device finishes nothing, and is reported elsewhere. */
  async #waitForRoom(queue: GPUQueue): Promise<void> {
    const start = performance.now();
    const finished = queue.onSubmittedWorkDone().then(
      () => (this.#isSlow = performance.now() - start > SLOW_RUN_MS),
      () => undefined,
    );
    this.#unfinished.push(finished);
    while (this.#unfinished.length >= (this.#isSlow ? 1 : MAX_IN_FLIGHT)) await this.#unfinished.shift();
  }
}
