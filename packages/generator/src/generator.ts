import { ContractError, type GaussianLayout } from '@gaussian-splat/core';
import { Chain } from './chain/chain.js';
import { sameInputs, type Inputs } from './input-value.js';
import { RunLoop } from './run-loop.js';
import type { RunOutputs, SessionKind } from './runtime/live-session.js';
import type { GeneratorModel, ModelSource } from './runtime/open-model.js';
import type { AcquireOptions } from './runtime/shared-sessions.js';
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

/** A model that writes Gaussians. */
export type GaussianModelFile = GeneratorModel & { readonly layout: GaussianLayout };

interface Wish {
  readonly state: GeneratorState;
  readonly inputs: readonly Inputs[];
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
  readonly #chain: Chain;
  readonly #options: GeneratorOptions;
  readonly #loop: RunLoop<Wish>;
  #shown: Wish['inputs'] | undefined;
  #runs = 0;

  private constructor(chain: Chain, options: GeneratorOptions) {
    this.#chain = chain;
    this.#options = options;
    this.#loop = new RunLoop({
      queue: chain.device.queue,
      isDue: ({ inputs }) => this.sink !== undefined && !this.#shows(inputs),
      run: (wish) => this.#run(wish),
      onError: (error) => this.#options.onError?.(error),
    });
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
    const chain = await Chain.open(source, device, options);
    try {
      requireGaussians(chain.models.at(-1)!);
      return new Generator(chain, options);
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
    return this.#chain.kind;
  }

  /** Runs that have reached the sink. */
  get runs(): number {
    return this.#runs;
  }

  /** Fulfils, and never rejects, when no run is on its way. */
  get idle(): Promise<void> {
    return this.#loop.idle;
  }

  /**
   * Asks for the Gaussians of a state. Returns at once; a request that has not started yet is replaced, and a state whose inputs are
   * those on show is not run at all.
   * @throws GaussianSplatError `argument/value` if the state does not fit the contract.
   */
  request(state: GeneratorState): void {
    if (!this.#loop.isClosed) this.#loop.request({ state, inputs: this.#chain.bind(state) });
  }

  /** Ends it: a run on its way reaches nobody any more. */
  close(): void {
    this.#loop.close();
    this.#chain.release(this.#loop.idle);
  }

  #shows(inputs: Wish['inputs']): boolean {
    return this.#shown?.every((shown, i) => sameInputs(shown, inputs[i])) ?? false;
  }

  async #run({ state, inputs }: Wish): Promise<void> {
    const start = performance.now();
    await this.#chain.run(inputs, ({ tensors, rows }) => {
      if (this.#loop.isClosed) return;
      this.sink?.ingest(tensors, rows);
      this.#shown = inputs;
      this.#runs++;
    });
    if (!this.#loop.isClosed) this.#options.onFrame?.({ state, milliseconds: performance.now() - start });
  }
}

function requireGaussians({ header, layout }: GeneratorModel): void {
  if (layout !== undefined) return;
  throw new ContractError([
    {
      code: 'contract/chain',
      where: header.name,
      expected: 'a model that writes Gaussians',
      found: 'a post-processor, which writes a picture',
      remedy: 'name it in the attribute postprocess, or open it with PostProcessor.open',
    },
  ]);
}
