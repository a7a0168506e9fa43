import { GaussianSplatError } from '@gaussian-splat/core';
import { ContractError, type Contract, type GaussianLayout } from '@gaussian-splat/core/contract';
import type { DynamicGaussians, Placed, Placement, World } from '@gaussian-splat/renderer';
import { Generator, type GaussianSink, type GeneratedFrame, type GeneratorOptions } from './generator.js';
import type { ModelSource } from './runtime/open-model.js';
import { receiveGaussians, type ThreeScene } from './scene-hosts.js';
import type { GeneratorState } from './state.js';

/** Creates the sink for the Gaussians of a model, for example `DynamicGaussians.create(device, layout)`. */
export type MakeSink<S extends GaussianSink> = (layout: GaussianLayout, contract: Contract) => S | Promise<S>;

/** A model in the scene. */
export interface GaussianModel<S extends GaussianSink = GaussianSink> {
  /** Registered name of its generator. */
  readonly name: string;
  readonly generator: Generator;
  /** The drawn Gaussians. */
  readonly gaussians: S;
  /** State of this model only, in addition to that of `runGenerators`. */
  state: GeneratorState;
  /** Its placement in a `World`; undefined elsewhere. */
  readonly placement: Placement | undefined;
  /** Removes it from the scene. A sink that the page created stays; one that was created for a scene is destroyed. */
  remove(): void;
}

/** Destination of a model: a world, a scene of three.js, or a factory of a sink. */
export type GaussianModelScene<S extends GaussianSink = GaussianSink> = World | ThreeScene | MakeSink<S>;

/** Returns changed inputs of a model for the next run, or nothing to keep them. */
export type FrameUpdate = (state: GeneratorState, model: GaussianModel) => GeneratorState | undefined | void;

/** The Gaussians of a model, with the members that only a scene provides. */
type Hosted = Pick<GaussianModel, 'gaussians'> & Partial<Pick<GaussianModel, 'placement' | 'remove'>>;

/** A generator with its source. */
interface Registered {
  readonly source: ModelSource;
  readonly after: string | undefined;
}

/** Generators by name, and the models that use them: a registry for pages with several generators. */
export class GaussianModels {
  readonly #sources = new Map<string, Registered>();
  readonly #models = new Set<GaussianModel>();
  readonly #updates = new Set<FrameUpdate>();
  readonly #listeners = new Set<(model: GaussianModel, frame: GeneratedFrame) => void>();
  readonly #failures = new Set<(model: GaussianModel | undefined, error: unknown) => void>();
  /** Generators by name, loading or loaded. */
  readonly #loaded = new Map<string, Promise<Generator>>();
  #device: GPUDevice | undefined;
  #cleared = new AbortController();

  /**
   * Registers a generator. Nothing is fetched yet.
   * @param options.after Name of the generator whose Gaussians this one receives: they run as a chain.
   */
  registerGaussianGenerator(name: string, source: ModelSource, options: { readonly after?: string } = {}): void {
    this.#sources.set(name, { source, after: options.after });
  }

  /**
   * Fetches and checks all registered generators, for a device. Loaded or loading ones are not fetched again.
   * @throws errors of `Generator.open` for the first that fails; ContractError `contract/chain` for a cycle of
   * generators, GaussianSplatError `argument/value` for one that follows an unknown name; an `AbortError` if {@link
   * clear} is called meanwhile.
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
   * Adds a model to a scene. Models of one generator share its session.
   *
   * ```ts
   * await models.addGaussianModelToScene('ball', world, { sceneToWorld }); // drawn by each Viewpoint of the world
   * await models.addGaussianModelToScene('ball', scene); // of three.js, drawn by a SplatRenderer
   * await models.addGaussianModelToScene('ball', (layout) => DynamicGaussians.create(device, layout)); // a sink of your own
   * ```
   * @param placed Its placement in a world.
   * @throws GaussianSplatError `argument/value` for a name that is not registered, before {@link loadAllGenerators}, or
   * for a scene without a renderer; errors of `makeSink`; an `AbortError` if {@link clear} is called meanwhile: a sink
   * from `makeSink` then stays with the caller.
   */
  async addGaussianModelToScene(
    name: string,
    world: World,
    placed?: Omit<Placed, 'scene'>,
  ): Promise<GaussianModel<DynamicGaussians> & { readonly placement: Placement }>;
  async addGaussianModelToScene(name: string, scene: ThreeScene): Promise<GaussianModel>;
  async addGaussianModelToScene<S extends GaussianSink>(name: string, makeSink: MakeSink<S>): Promise<GaussianModel<S>>;
  async addGaussianModelToScene(
    name: string,
    scene: GaussianModelScene,
    placed?: Omit<Placed, 'scene'>,
  ): Promise<GaussianModel> {
    const device = this.#device;
    if (device === undefined) throw unknownGenerator(name, [...this.#sources.keys()]);
    const { signal } = this.#cleared;
    const generator = await this.#open(name, device, {
      signal,
      onFrame: (frame) => this.#listeners.forEach((listener) => listener(model, frame)),
      onError: (error) => this.#failures.forEach((listener) => listener(model, error)),
    });
    const { layout, contract } = generator.model;
    let hosted: Hosted;
    try {
      hosted =
        typeof scene === 'function'
          ? { gaussians: await scene(layout, contract) }
          : await receiveGaussians(scene, device, layout, placed);
    } catch (error) {
      generator.close();
      throw error;
    }
    const { gaussians, placement } = hosted;
    const remove = (): void => {
      this.#models.delete(model);
      generator.close();
      hosted.remove?.();
    };
    const model: GaussianModel = { name, generator, gaussians, placement, state: {}, remove };
    if (signal.aborted) {
      remove();
      throw signal.reason;
    }
    generator.sink = gaussians;
    this.#models.add(model);
    return model;
  }

  /**
   * Calls `update` before each run of each model. Its result overrides the state of {@link runGenerators}.
   *
   * ```ts
   * models.onFrame(({ timeSeconds = 0 }) => ({ controls: { swing: Math.sin(timeSeconds) } }));
   * ```
   * @returns A function that unsubscribes.
   */
  onFrame(update: FrameUpdate): () => void {
    this.#updates.add(update);
    return () => this.#updates.delete(update);
  }

  /**
   * Calls `listener` with each finished run of each model, and `onError` with failed runs. @returns A function that
   * unsubscribes.
   */
  onGenerated(
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
   * Requests the Gaussians of a state from all models; results of {@link onFrame} callbacks and each model's own
   * `state` override it. Returns at once.
   * @throws GaussianSplatError `argument/value` if a state does not match a contract.
   */
  runGenerators(state: GeneratorState = {}): void {
    for (const model of this.#models) {
      let asked = state;
      for (const update of this.#updates) asked = merged(asked, update(asked, model) ?? {});
      requireControls(model);
      model.generator.request(merged(asked, model.state));
    }
  }

  /** Removes all models and all names. */
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

  /** Also rejects if the generator was loaded but has been cleared meanwhile. */
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

  /** Sources from the first generator of the chain to the given one. */
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

/** Merges controls and images by name; other fields of the second override the first. */
function merged(state: GeneratorState, over: GeneratorState): GeneratorState {
  const { controls, images } = state;
  return {
    ...state,
    ...over,
    ...(controls && over.controls ? { controls: { ...controls, ...over.controls } } : {}),
    ...(images && over.images ? { images: { ...images, ...over.images } } : {}),
  };
}

/** Controls of a single model must exist in it; those of all models may belong to others. */
function requireControls({ name, generator, state }: GaussianModel): void {
  if (state.controls === undefined) return;
  const known = generator.models.flatMap(({ contract }) =>
    Object.entries(contract.inputs).flatMap(([input, { role }]) => (role === 'control' ? [input] : [])),
  );
  const unknown = Object.keys(state.controls).find((control) => !known.includes(control));
  if (unknown === undefined) return;
  throw new GaussianSplatError('argument/value', {
    where: `state.controls of generator ${JSON.stringify(name)}`,
    expected: known.length > 0 ? `controls of its contract: ${known.join(', ')}` : 'no controls: its contract has none',
    found: unknown,
    remedy: 'correct the name, or declare the control in the contract',
  });
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

/** The default registry of the page. */
const page = new GaussianModels();

/** {@link GaussianModels.registerGaussianGenerator} of the default registry. */
export const registerGaussianGenerator: GaussianModels['registerGaussianGenerator'] = (name, source, options) =>
  page.registerGaussianGenerator(name, source, options);
/** {@link GaussianModels.loadAllGenerators} of the default registry. */
export const loadAllGenerators: GaussianModels['loadAllGenerators'] = (device) => page.loadAllGenerators(device);
/** {@link GaussianModels.addGaussianModelToScene} of the default registry. */
export const addGaussianModelToScene: GaussianModels['addGaussianModelToScene'] =
  page.addGaussianModelToScene.bind(page);
/** {@link GaussianModels.onFrame} of the default registry. */
export const onFrame: GaussianModels['onFrame'] = (update) => page.onFrame(update);
/** {@link GaussianModels.onGenerated} of the default registry. */
export const onGenerated: GaussianModels['onGenerated'] = (listener, onError) => page.onGenerated(listener, onError);
/** {@link GaussianModels.runGenerators} of the default registry. */
export const runGenerators: GaussianModels['runGenerators'] = (state) => page.runGenerators(state);
