import { ContractError, type GaussianLayout } from '@gaussian-splat/core/contract';
import { batchOf, type BatchSlot } from './batch/batch.js';
import { Chain, requireNoneBefore } from './chain/chain.js';
import { sameInputs, type Inputs } from './input-value.js';
import { RunLoop } from './run-loop.js';
import type { GeneratorSession } from './runtime/generator-session.js';
import type { RunOutputs, SessionKind } from './runtime/ort-session.js';
import type { GeneratorModel, ModelSource } from './runtime/open-model.js';
import type { AcquireOptions } from './runtime/shared-sessions.js';
import type { GeneratorState } from './state.js';

/**
 * Consumes the output of runs, as `DynamicGaussians` of the renderer does. An implementation must submit its GPU work
 * before it returns.
 */
export interface GaussianSink {
  /**
   * Receives the output of a run.
   * @param rows Number of rows of one instance.
   * @param instance Index of this instance in a run of several. Its rows begin in each tensor at `instance * rows`, and
   * its count of valid rows is element `instance` of the count tensor.
   */
  ingest(tensors: RunOutputs['tensors'], rows: number, instance: number): void;
}

/** A run whose Gaussians have reached the sink. */
export interface GeneratedFrame {
  /** State that was requested for the run. */
  readonly state: GeneratorState;
  /** Milliseconds from the start of the run until its work was submitted. The GPU may not have finished. */
  readonly milliseconds: number;
}

export interface GeneratorOptions extends AcquireOptions {
  /**
   * Called with the received and total bytes of all models, and of the runtime unless it is loaded. The total is
   * undefined while unknown. Calls continue after {@link Generator.open}, until the first run has loaded the runtime.
   */
  readonly onProgress?: AcquireOptions['onProgress'];
  readonly onFrame?: (frame: GeneratedFrame) => void;
  /** Called with the error of a failed run. The previous content remains, and the next request tries again. */
  readonly onError?: (error: unknown) => void;
}

/** A validated model that writes Gaussians. */
export type GaussianModelFile = GeneratorModel & { readonly layout: GaussianLayout };

interface RunRequest {
  readonly state: GeneratorState;
  readonly inputs: readonly Inputs[];
}

/** Request of one instance in a batch. */
interface InstanceRequest {
  readonly state: GeneratorState;
  readonly inputs: Inputs;
}

/**
 * One instance of a generator. It runs for the latest requested state, and starts a run only when an earlier one has
 * ended. Instances of a model whose contract declares them run together.
 *
 * ```ts
 * const generator = await Generator.open({ url: 'walker.onnx' }, device, { onFrame: requestDraw });
 * generator.sink = await DynamicGaussians.create(device, generator.model.layout);
 * generator.request({ camera, timeSeconds }); // any number of times
 * ```
 */
export class Generator {
  /** Destination of the output of runs. Without a sink, nothing runs. */
  sink: GaussianSink | undefined;
  /** All models of the chain, in execution order. */
  readonly models: readonly GeneratorModel[];
  readonly #chain: Chain;
  readonly #options: GeneratorOptions;
  readonly #runner: RunLoop<RunRequest> | BatchSlot<InstanceRequest>;
  #shown: RunRequest['inputs'] | undefined;
  #asked: RunRequest | undefined;
  /** Time of the last requested run, seconds. An earlier time resets the state of the models. */
  #timeSeconds = 0;
  #runs = 0;
  readonly #followers = new Set<(outputs: RunOutputs) => void>();

  private constructor(chain: Chain, options: GeneratorOptions) {
    this.#chain = chain;
    this.#options = options;
    this.models = chain.models;
    const { ofInstances } = chain;
    this.#runner = ofInstances ? this.#seatOf(ofInstances) : this.#ownLoop();
  }

  /**
   * Fetches a generator, or a chain of generators, each with the Gaussians of the previous one, and checks
   * them. The runtime is not fetched yet.
   * @throws ContractError, GaussianSplatError: see `openModel`; ContractError `contract/chain` for models that do not
   * match, or whose last one writes no Gaussians.
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
      requireNoneBefore(chain.models[0]);
      requireGaussians(chain.models.at(-1)!);
      return (generator = new Generator(chain, options));
    } catch (error) {
      chain.release();
      throw error;
    }
  }

  /** The model whose output is drawn, which is the last of a chain. */
  get model(): GaussianModelFile {
    return this.models.at(-1) as GaussianModelFile;
  }

  /** Slowest session kind of all models; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#runner instanceof RunLoop ? this.#chain.kind : this.#runner.kind;
  }

  /** Number of runs that have reached the sink. */
  get runs(): number {
    return this.#runs;
  }

  /** Fulfills when no run is in progress. Never rejects. */
  get idle(): Promise<void> {
    return this.#runner.idle;
  }

  /**
   * Requests the Gaussians of a state, and returns at once. Replaces a request that has not started yet. A state whose
   * inputs equal those of the current content is not run.
   * @throws GaussianSplatError `argument/value` if the state does not match the contract.
   */
  request(state: GeneratorState): void {
    if (this.#runner.isClosed) return;
    const inputs = this.#chain.bind(state);
    this.#asked = { state, inputs };
    this.#askFor(this.#asked);
  }

  /**
   * Calls a function with the outputs of each run, and runs the last state again for it. The function must submit its
   * GPU work before it returns, because the runtime then reuses the buffers.
   * @returns A function that ends the calls.
   */
  follow(take: (outputs: RunOutputs) => void): () => void {
    this.#followers.add(take);
    this.#askAgain();
    return () => void this.#followers.delete(take);
  }

  /** Requests the last state again: after a failed check of the session, or for a follower. */
  #askAgain(): void {
    this.#chain.forget();
    this.#shown = undefined;
    if (this.#asked !== undefined) this.#askFor(this.#asked);
  }

  #askFor({ state, inputs }: RunRequest): void {
    if (this.#runner instanceof RunLoop) this.#runner.request({ state, inputs });
    else this.#runner.request({ state, inputs: inputs[0] });
  }

  /** Closes the generator. A run in progress has no effect anymore. */
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

  #seatOf(session: GeneratorSession): BatchSlot<InstanceRequest> {
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

  #take(inputs: RunRequest['inputs'], outputs: RunOutputs, instance: number): void {
    if (this.#runner.isClosed) return;
    this.sink?.ingest(outputs.tensors, outputs.rows, instance);
    for (const take of this.#followers) take(outputs);
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
