import { ContractError, type GaussianLayout } from '@gaussian-splat/core/contract';
import { batchOf, type Seat } from './batch/batch.js';
import { Chain } from './chain/chain.js';
import { sameInputs, type Inputs } from './input-value.js';
import { RunLoop } from './run-loop.js';
import type { GeneratorSession } from './runtime/generator-session.js';
import type { RunOutputs, SessionKind } from './runtime/live-session.js';
import type { GeneratorModel, ModelSource } from './runtime/open-model.js';
import type { AcquireOptions } from './runtime/shared-sessions.js';
import type { GeneratorState } from './state.js';

/** Takes what runs write: `DynamicGaussians` of the renderer is one. It must submit its work before it returns. */
export interface GaussianSink {
  /**
   * @param rows of one instance.
   * @param instance which instance of a run of several is this one's, 0 and up: its rows begin in each tensor at `instance * rows`, and its live
   * count is element `instance` of that tensor.
   */
  ingest(tensors: RunOutputs['tensors'], rows: number, instance: number): void;
}

/** A run whose Gaussians have reached the sink. */
export interface GeneratedFrame {
  /** The state that it shows. */
  readonly state: GeneratorState;
  /** From the start of the run until its work was submitted, ms; the GPU may still be at it. */
  readonly milliseconds: number;
}

export interface GeneratorOptions extends AcquireOptions {
  /**
   * Bytes until now of all models and of the runtime, if that is not there yet, and of how many. Goes on after {@link Generator.open}, until the
   * runtime has come with the first run; warming up comes after that.
   */
  readonly onProgress?: AcquireOptions['onProgress'];
  readonly onFrame?: (frame: GeneratedFrame) => void;
  /** A run failed; what was shown before stays. The next request tries again. */
  readonly onError?: (error: unknown) => void;
}

/** A model that writes Gaussians. */
export type GaussianModelFile = GeneratorModel & { readonly layout: GaussianLayout };

interface RunRequest {
  readonly state: GeneratorState;
  readonly inputs: readonly Inputs[];
}

/** The wish of an instance among others of its model. */
interface InstanceRequest {
  readonly state: GeneratorState;
  readonly inputs: Inputs;
}

/**
 * One instance of a generator: runs it for the latest state asked for, as fast as runs finish and never faster. Instances of a model whose
 * contract declares them run together.
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
  readonly #chain: Chain;
  readonly #options: GeneratorOptions;
  readonly #runner: RunLoop<RunRequest> | Seat<InstanceRequest>;
  #shown: RunRequest['inputs'] | undefined;
  #asked: RunRequest | undefined;
  /** Of the last run. */
  #timeSeconds = 0;
  #runs = 0;

  private constructor(chain: Chain, options: GeneratorOptions) {
    this.#chain = chain;
    this.#options = options;
    const { ofInstances } = chain;
    this.#runner = ofInstances ? this.#seatOf(ofInstances) : this.#ownLoop();
  }

  /**
   * Fetches a generator, or several of which each takes the Gaussians of the one before it, and checks them; not a byte of the runtime
   * is fetched yet.
   * @throws ContractError, GaussianSplatError: see `openModel`; ContractError `contract/chain` for models that do not fit one another, or do
   * not write Gaussians in the end.
   */
  static async open(
    source: ModelSource | readonly ModelSource[],
    device: GPUDevice,
    options: GeneratorOptions = {},
  ): Promise<Generator> {
    let generator: Generator | undefined;
    const onFallback = (reason: string): void => {
      options.onFallback?.(reason);
      if (generator) generator.#askAgain();
    };
    const chain = await Chain.open(source, device, { ...options, onFallback });
    try {
      requireGaussians(chain.models.at(-1)!);
      return (generator = new Generator(chain, options));
    } catch (error) {
      chain.release();
      throw error;
    }
  }

  /** The model that writes what is drawn: the last of a chain. */
  get model(): GaussianModelFile {
    return this.#chain.models.at(-1) as GaussianModelFile;
  }

  /** All models of the chain, in the order in which they run. */
  get models(): readonly GeneratorModel[] {
    return this.#chain.models;
  }

  /** How it runs, by the slowest of its models; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#runner instanceof RunLoop ? this.#chain.kind : this.#runner.kind;
  }

  /** Runs that have reached the sink. */
  get runs(): number {
    return this.#runs;
  }

  /** Fulfils, and never rejects, when no run is on its way. */
  get idle(): Promise<void> {
    return this.#runner.idle;
  }

  /**
   * Asks for the Gaussians of a state. Returns at once; a request that has not started yet is replaced, and a state whose inputs are
   * those shown is not run at all.
   * @throws GaussianSplatError `argument/value` if the state does not fit the contract.
   */
  request(state: GeneratorState): void {
    if (this.#runner.isClosed) return;
    const inputs = this.#chain.bind(state);
    this.#asked = { state, inputs };
    this.#askFor(this.#asked);
  }

  /** What is on show was written by a session that is not to be trusted. */
  #askAgain(): void {
    this.#chain.forget();
    this.#shown = undefined;
    if (this.#asked !== undefined) this.#askFor(this.#asked);
  }

  #askFor({ state, inputs }: RunRequest): void {
    if (this.#runner instanceof RunLoop) this.#runner.request({ state, inputs });
    else this.#runner.request({ state, inputs: inputs[0] });
  }

  /** Ends it: a run on its way has no effect any more. */
  close(): void {
    this.#runner.close();
    this.#chain.release(this.#runner.idle);
  }

  #ownLoop(): RunLoop<RunRequest> {
    return new RunLoop<RunRequest>({
      queue: this.#chain.device.queue,
      isDue: ({ inputs }) => this.#isDue(inputs),
      run: (request) => this.#run(request),
      onError: (error) => this.#options.onError?.(error),
    });
  }

  #seatOf(session: GeneratorSession): Seat<InstanceRequest> {
    return batchOf(session).join<InstanceRequest>({
      isDue: ({ inputs }) => this.#isDue([inputs]),
      take: ({ inputs }, outputs, instance) => this.#take([inputs], outputs, instance),
      onTaken: ({ state }, start) => this.#announce(state, start),
      onError: (error) => this.#options.onError?.(error),
    });
  }

  #isDue(inputs: RunRequest['inputs']): boolean {
    const isShown = this.#shown?.every((shown, i) => sameInputs(shown, inputs[i])) ?? false;
    return this.sink !== undefined && !isShown;
  }

  #take(inputs: RunRequest['inputs'], { tensors, rows }: RunOutputs, instance: number): void {
    if (this.#runner.isClosed) return;
    this.sink?.ingest(tensors, rows, instance);
    this.#shown = inputs;
    this.#runs++;
  }

  async #run({ state, inputs }: RunRequest): Promise<void> {
    const start = performance.now();
    const { timeSeconds = 0 } = state;
    if (timeSeconds < this.#timeSeconds) this.#chain.restart();
    this.#timeSeconds = timeSeconds;
    await this.#chain.run(inputs, (outputs) => this.#take(inputs, outputs, 0));
    this.#announce(state, start);
  }

  #announce(state: GeneratorState, start: number): void {
    if (!this.#runner.isClosed) this.#options.onFrame?.({ state, milliseconds: performance.now() - start });
  }
}

function requireGaussians({ header, layout }: GeneratorModel): void {
  if (layout !== undefined) return;
  throw new ContractError([
    {
      code: 'contract/chain',
      where: header.name,
      expected: 'a model that writes Gaussians',
      found: 'a post-processor, which writes an image',
      remedy: 'name it in the attribute postprocess, or open it with PostProcessor.open',
    },
  ]);
}
