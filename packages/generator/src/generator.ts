import { ContractError, type GaussianLayout } from '@gaussian-splat/core/contract';
import { batchOf, type BatchSlot } from './batch/batch.js';
import { Chain } from './chain/chain.js';
import { sameInputs, type Inputs } from './input-value.js';
import { RunLoop } from './run-loop.js';
import type { GeneratorSession } from './runtime/generator-session.js';
import type { RunOutputs, SessionKind } from './runtime/ort-session.js';
import type { GeneratorModel, ModelSource } from './runtime/open-model.js';
import type { AcquireOptions } from './runtime/shared-sessions.js';
import type { GeneratorState } from './state.js';

/**
 * Consumes the output of runs: `DynamicGaussians` of the renderer implements it. It must submit its work before it
 * returns.
 */
export interface GaussianSink {
  /**
   * @param rows Number of rows of one instance.
   * @param instance Index of this instance in a run of several: its rows begin in each tensor at `instance * rows`, and
   * its live count is element `instance` of that tensor.
   */
  ingest(tensors: RunOutputs['tensors'], rows: number, instance: number): void;
}

/** A run whose Gaussians have reached the sink. */
export interface GeneratedFrame {
  /** The state of the run. */
  readonly state: GeneratorState;
  /** From the start of the run until its work was submitted, ms; the GPU may not have finished. */
  readonly milliseconds: number;
}

export interface GeneratorOptions extends AcquireOptions {
  /**
   * Called with the received and total bytes of all models, and of the runtime unless it is loaded. Continues after
   * {@link Generator.open}, until the first run has loaded the runtime; warm-up follows.
   */
  readonly onProgress?: AcquireOptions['onProgress'];
  readonly onFrame?: (frame: GeneratedFrame) => void;
  /** Called when a run fails; the previous content remains. The next request tries again. */
  readonly onError?: (error: unknown) => void;
}

/** A model that writes Gaussians. */
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
 * One instance of a generator: runs it for the latest requested state, as fast as runs finish and never faster.
 * Instances of a model whose contract declares them run together.
 *
 * ```ts
 * const generator = await Generator.open({ url: 'walker.onnx' }, device, { onFrame: requestDraw });
 * generator.sink = await DynamicGaussians.create(device, generator.model.layout);
 * generator.request({ camera, timeSeconds }); // any number of times
 * ```
 */
export class Generator {
  /** Destination of runs; nothing runs without one. */
  sink: GaussianSink | undefined;
  readonly #chain: Chain;
  readonly #options: GeneratorOptions;
  readonly #runner: RunLoop<RunRequest> | BatchSlot<InstanceRequest>;
  #shown: RunRequest['inputs'] | undefined;
  #asked: RunRequest | undefined;
  /** Inputs of the last run. */
  #timeSeconds = 0;
  #runs = 0;

  private constructor(chain: Chain, options: GeneratorOptions) {
    this.#chain = chain;
    this.#options = options;
    const { ofInstances } = chain;
    this.#runner = ofInstances ? this.#seatOf(ofInstances) : this.#ownLoop();
  }

  /**
   * Fetches a generator, or a chain of generators that pass on their Gaussians, and checks them; the runtime is not
   * fetched yet.
   * @throws ContractError, GaussianSplatError: see `openModel`; ContractError `contract/chain` for models that do not
   * match, or whose last one does not write Gaussians.
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

  /** The model whose output is drawn: the last of a chain. */
  get model(): GaussianModelFile {
    return this.#chain.models.at(-1) as GaussianModelFile;
  }

  /** All models of the chain, in execution order. */
  get models(): readonly GeneratorModel[] {
    return this.#chain.models;
  }

  /** Session kind of its slowest model; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#runner instanceof RunLoop ? this.#chain.kind : this.#runner.kind;
  }

  /** Number of runs that have reached the sink. */
  get runs(): number {
    return this.#runs;
  }

  /** Resolves, and never rejects, when no run is in progress. */
  get idle(): Promise<void> {
    return this.#runner.idle;
  }

  /**
   * Requests the Gaussians of a state. Returns at once; a request that has not started yet is replaced, and a state
   * with the inputs of the current content is not run.
   * @throws GaussianSplatError `argument/value` if the state does not match the contract.
   */
  request(state: GeneratorState): void {
    if (this.#runner.isClosed) return;
    const inputs = this.#chain.bind(state);
    this.#asked = { state, inputs };
    this.#askFor(this.#asked);
  }

  /** A session that failed its check has written the current content. */
  #askAgain(): void {
    this.#chain.forget();
    this.#shown = undefined;
    if (this.#asked !== undefined) this.#askFor(this.#asked);
  }

  #askFor({ state, inputs }: RunRequest): void {
    if (this.#runner instanceof RunLoop) this.#runner.request({ state, inputs });
    else this.#runner.request({ state, inputs: inputs[0] });
  }

  /** Closes it: a run in progress has no effect any more. */
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
