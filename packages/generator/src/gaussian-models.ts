import { GaussianSplatError } from '@gaussian-splat/core';
import { ContractError, type Contract, type GaussianLayout } from '@gaussian-splat/core/contract';
import type { DynamicGaussians, Placed, Placement, World } from '@gaussian-splat/renderer';
import { Generator, type GaussianSink, type GeneratedFrame, type GeneratorOptions } from './generator.js';
import type { ModelSource } from './runtime/open-model.js';
import { receiveGaussians, type ThreeScene } from './scene-hosts.js';
import type { GeneratorState } from './state.js';

/** Creates the sink that receives a model's Gaussians, for example `DynamicGaussians.create(device, layout)`. */
export type MakeSink<S extends GaussianSink> = (layout: GaussianLayout, contract: Contract) => S | Promise<S>;

/** A model that is added to a scene. */
export interface GaussianModel<S extends GaussianSink = GaussianSink> {
  /** Registered name of the model's generator. */
  readonly name: string;
  readonly generator: Generator;
  /** Sink with the model's Gaussians. */
  readonly gaussians: S;
  /** State of this model only. It takes precedence over the state of `runGenerators`. */
  state: GeneratorState;
  /** Placement of the model in a `World`; undefined for other scenes. */
  readonly placement: Placement | undefined;
  /** Removes the model from the scene. Destroys the sink, unless the page has created it. */
  remove(): void;
}

/** Destination of a model: a world, a scene of three.js, or a function that creates a sink. */
export type GaussianModelScene<S extends GaussianSink = GaussianSink> = World | ThreeScene | MakeSink<S>;

/** Called before each run of a model. Returns state that overrides the given one, or undefined for no change. */
export type FrameUpdate = (state: GeneratorState, model: GaussianModel) => GeneratorState | undefined | void;

/** The Gaussians of a model, with the members that only a scene provides. */
type Hosted = Pick<GaussianModel, 'gaussians'> & Partial<Pick<GaussianModel, 'placement' | 'remove'>>;

/** A registered source; `after` is the name of the generator whose Gaussians it receives. */
interface Registered {
  readonly source: ModelSource;
  readonly after: string | undefined;
}

/** Registry of generators by name, with the models that use them, for pages with several generators. */
export class GaussianModels {
  readonly #sources = new Map<string, Registered>();
  readonly #models = new Set<GaussianModel>();
  readonly #updates = new Set<FrameUpdate>();
  readonly #listeners = new Set<(model: GaussianModel, frame: GeneratedFrame) => void>();
  readonly #failures = new Set<(model: GaussianModel | undefined, error: unknown) => void>();
  /** Generators by name that are loaded or loading. */
  readonly #loaded = new Map<string, Promise<Generator>>();
  #device: GPUDevice | undefined;
  #cleared = new AbortController();

  /**
   * Registers a generator under a name. Nothing is fetched yet.
   * @param options.after Name of the generator whose Gaussians are inputs of this one; both run as a chain.
   */
  registerGaussianGenerator(name: string, source: ModelSource, options: { readonly after?: string } = {}): void {
    this.#sources.set(name, { source, after: options.after });
  }

  /**
   * Fetches and checks all registered generators for a device. Generators that are loaded or loading are not fetched
   * again, except for another device, which replaces the first one.
   * @throws the errors of `Generator.open` for the first that fails; ContractError `contract/chain` for a cycle of
   * generators; GaussianSplatError `argument/value` for a generator after an unknown name; an `AbortError` if {@link
   * clear} is called meanwhile.
   */
  async loadAllGenerators(device: GPUDevice): Promise<void> {
    if (device !== this.#device) this.#closeLoaded();
    this.#device = device;
    const { signal } = this.#cleared;
    await Promise.all(
      [...this.#sources.keys()].map((name) => {
        const known = this.#loaded.get(name);
        if (known) return known;
        const opening = this.#open(name, device, { signal });
        this.#loaded.set(name, opening);
        // The next call loads the generator again.
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
   * @throws the errors of {@link Generator.open}; GaussianSplatError `argument/value` for a name that is not registered,
   * before {@link loadAllGenerators}, or for a scene without a renderer; errors of `makeSink`; an `AbortError`
   * if {@link clear} is called meanwhile: a sink from `makeSink` then stays with the caller.
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
   * Requests the Gaussians of a state from all models, and returns at once. Results of {@link onFrame} callbacks and
   * each model's own `state` take precedence.
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

  /** Removes all models and all registered generators. */
  clear(): void {
    for (const model of [...this.#models]) model.remove();
    this.#cleared.abort();
    this.#cleared = new AbortController();
    this.#closeLoaded();
    this.#sources.clear();
    this.#device = undefined;
  }

  #closeLoaded(): void {
    for (const opening of this.#loaded.values())
      opening.then(
        (generator) => generator.close(),
        () => undefined,
      );
    this.#loaded.clear();
  }

  /** Opens a generator. Also rejects if the registry was cleared after the generator was loaded. */
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

  /** Returns the sources of a chain, from its first generator to the given one. */
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

/** Returns a state with the fields of `over` in place of those of `state`. Controls and images are merged by name. */
function merged(state: GeneratorState, over: GeneratorState): GeneratorState {
  const { controls, images } = state;
  return {
    ...state,
    ...over,
    ...(controls && over.controls ? { controls: { ...controls, ...over.controls } } : {}),
    ...(images && over.images ? { images: { ...images, ...over.images } } : {}),
  };
}

/**
 * Requires that a contract of the model declares each control of its own state. Controls in the state for all models
 * are not checked, because they may belong to other models.
 * @throws GaussianSplatError `argument/value`
 */
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

/** Calls {@link GaussianModels.registerGaussianGenerator} of the page's default registry. */
export const registerGaussianGenerator: GaussianModels['registerGaussianGenerator'] = (name, source, options) =>
  page.registerGaussianGenerator(name, source, options);
/** Calls {@link GaussianModels.loadAllGenerators} of the page's default registry. */
export const loadAllGenerators: GaussianModels['loadAllGenerators'] = (device) => page.loadAllGenerators(device);
/** Calls {@link GaussianModels.addGaussianModelToScene} of the page's default registry. */
export const addGaussianModelToScene: GaussianModels['addGaussianModelToScene'] =
  page.addGaussianModelToScene.bind(page);
/** Calls {@link GaussianModels.onFrame} of the page's default registry. */
export const onFrame: GaussianModels['onFrame'] = (update) => page.onFrame(update);
/** Calls {@link GaussianModels.onGenerated} of the page's default registry. */
export const onGenerated: GaussianModels['onGenerated'] = (listener, onError) => page.onGenerated(listener, onError);
/** Calls {@link GaussianModels.runGenerators} of the page's default registry. */
export const runGenerators: GaussianModels['runGenerators'] = (state) => page.runGenerators(state);
