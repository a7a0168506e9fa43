import { GaussianSplatError } from '@gaussian-splat/core';
import { ContractError, type Contract, type GaussianLayout } from '@gaussian-splat/core/contract';
import { Generator, type GaussianSink, type GeneratedFrame, type GeneratorOptions } from './generator.js';
import type { ModelSource } from './runtime/open-model.js';
import type { GeneratorState } from './state.js';

/** Makes what the Gaussians of a model are written into, for example `DynamicGaussians.create(device, layout)`. */
export type MakeSink<S extends GaussianSink> = (layout: GaussianLayout, contract: Contract) => S | Promise<S>;

/** A model in the scene. */
export interface GaussianModel<S extends GaussianSink = GaussianSink> {
  readonly generator: Generator;
  /** What is drawn. */
  readonly gaussians: S;
  /** State of this model alone, on top of what `runGenerators` is given. */
  state: GeneratorState;
  /** Takes it out of the scene. The sink belongs to its maker. */
  remove(): void;
}

/** A generator by its name. */
interface Registered {
  readonly source: ModelSource;
  readonly after: string | undefined;
}

/** Generators by name, and the models that show them: what a page of several generators keeps. */
export class GaussianModels {
  readonly #sources = new Map<string, Registered>();
  readonly #models = new Set<GaussianModel>();
  readonly #listeners = new Set<(model: GaussianModel, frame: GeneratedFrame) => void>();
  readonly #failures = new Set<(model: GaussianModel | undefined, error: unknown) => void>();
  /** Generators by name, on their way or there. */
  readonly #loaded = new Map<string, Promise<Generator>>();
  #device: GPUDevice | undefined;
  #cleared = new AbortController();

  /**
   * Gives a generator a name. Nothing is fetched yet.
   * @param options.after name of the generator whose Gaussians this one takes: they run as a chain.
   */
  registerGaussianGenerator(name: string, source: ModelSource, options: { readonly after?: string } = {}): void {
    this.#sources.set(name, { source, after: options.after });
  }

  /**
   * Fetches and checks all registered generators, for a device. Those that are there, or on their way, are not fetched again.
   * @throws what `Generator.open` throws for the first that fails; ContractError `contract/chain` for generators that follow one another in
   * a circle, GaussianSplatError `argument/value` for one that follows an unknown name; an `AbortError` if {@link clear} is called meanwhile.
   */
  async loadAllGenerators(device: GPUDevice): Promise<void> {
    this.#device = device;
    const { signal } = this.#cleared;
    await Promise.all(
      [...this.#sources.keys()].map((name) => {
        const known = this.#loaded.get(name);
        if (known) return known;
        const opening = this.#open(name, device, { signal });
        this.#loaded.set(name, opening);
        // The next call tries again.
        opening.catch(() => this.#loaded.get(name) === opening && this.#loaded.delete(name));
        return opening;
      }),
    );
  }

  /**
   * Puts a model into the scene. Models of one generator share its session.
   * @throws GaussianSplatError `argument/value` for a name that is not registered, or before {@link loadAllGenerators}; what `makeSink` throws;
   * an `AbortError` if {@link clear} is called meanwhile: a sink that `makeSink` has made then stays with its maker.
   */
  async addGaussianModelToScene<S extends GaussianSink>(
    name: string,
    makeSink: MakeSink<S>,
  ): Promise<GaussianModel<S>> {
    if (this.#device === undefined) throw unknownGenerator(name, [...this.#sources.keys()]);
    const { signal } = this.#cleared;
    const generator = await this.#open(name, this.#device, {
      signal,
      onFrame: (frame) => this.#listeners.forEach((listener) => listener(model, frame)),
      onError: (error) => this.#failures.forEach((listener) => listener(model, error)),
    });
    const { layout, contract } = generator.model;
    let gaussians: S;
    try {
      gaussians = await makeSink(layout, contract);
      signal.throwIfAborted();
    } catch (error) {
      generator.close();
      throw error;
    }
    generator.sink = gaussians;
    const remove = (): void => {
      this.#models.delete(model);
      generator.close();
    };
    const model: GaussianModel<S> = { generator, gaussians, state: {}, remove };
    this.#models.add(model);
    return model;
  }

  /** Listens to every new frame of every model, and to runs that fail. @returns what ends it. */
  onFrame(
    listener: (model: GaussianModel, frame: GeneratedFrame) => void,
    onError?: (model: GaussianModel | undefined, error: unknown) => void,
  ): () => void {
    this.#listeners.add(listener);
    if (onError) this.#failures.add(onError);
    return () => {
      this.#listeners.delete(listener);
      if (onError) this.#failures.delete(onError);
    };
  }

  /**
   * Asks all models for the Gaussians of a state; each model's own `state` counts above it. Returns at once.
   * @throws GaussianSplatError `argument/value` if a state does not fit a contract.
   */
  runGenerators(state: GeneratorState): void {
    for (const model of this.#models) model.generator.request({ ...state, ...model.state });
  }

  /** Takes all models out and forgets all names. */
  clear(): void {
    for (const model of [...this.#models]) model.remove();
    this.#cleared.abort();
    this.#cleared = new AbortController();
    for (const opening of this.#loaded.values())
      opening.then(
        (generator) => generator.close(),
        () => undefined,
      );
    this.#loaded.clear();
    this.#sources.clear();
    this.#device = undefined;
  }

  /** Rejects, too, where it is there but has been cleared meanwhile. */
  async #open(
    name: string,
    device: GPUDevice,
    options: GeneratorOptions & { signal: AbortSignal },
  ): Promise<Generator> {
    const generator = await Generator.open(this.#chainOf(name), device, options);
    if (!options.signal.aborted) return generator;
    generator.close();
    throw options.signal.reason;
  }

  /** Sources from the first of the chain that ends with a name. */
  #chainOf(last: string): readonly ModelSource[] {
    const names: string[] = [];
    for (let name: string | undefined = last; name !== undefined; name = this.#sources.get(name)?.after) {
      if (names.includes(name)) throw circle([...names, name]);
      if (!this.#sources.has(name)) throw unknownGenerator(name, [...this.#sources.keys()]);
      names.push(name);
    }
    return names.reverse().map((name) => this.#sources.get(name)!.source);
  }
}

const circle = (names: readonly string[]): ContractError =>
  new ContractError([
    {
      code: 'contract/chain',
      where: `generator ${names[0]}`,
      expected: 'a chain with a first generator, which takes no Gaussians',
      found: `a circle: ${names.join(' after ')}`,
      remedy: 'register one of them without "after"',
    },
  ]);

function unknownGenerator(name: string, known: readonly string[]): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: `generator ${JSON.stringify(name)}`,
    expected: 'a registered generator, and loadAllGenerators before',
    found: known.length > 0 ? `the registered generators ${known.join(', ')}` : 'no registered generator',
    remedy: 'call registerGaussianGenerator(name, source), then await loadAllGenerators(device)',
  });
}

/** The page's own. */
const page = new GaussianModels();

/** {@link GaussianModels.registerGaussianGenerator} of the page. */
export const registerGaussianGenerator: GaussianModels['registerGaussianGenerator'] = (name, source, options) =>
  page.registerGaussianGenerator(name, source, options);
/** {@link GaussianModels.loadAllGenerators} of the page. */
export const loadAllGenerators: GaussianModels['loadAllGenerators'] = (device) => page.loadAllGenerators(device);
/** {@link GaussianModels.addGaussianModelToScene} of the page. */
export const addGaussianModelToScene: GaussianModels['addGaussianModelToScene'] = (name, makeSink) =>
  page.addGaussianModelToScene(name, makeSink);
/** {@link GaussianModels.onFrame} of the page. */
export const onFrame: GaussianModels['onFrame'] = (listener, onError) => page.onFrame(listener, onError);
/** {@link GaussianModels.runGenerators} of the page. */
export const runGenerators: GaussianModels['runGenerators'] = (state) => page.runGenerators(state);
