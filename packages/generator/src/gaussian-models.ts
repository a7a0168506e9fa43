import { GaussianSplatError } from '@gaussian-splat/core';
import { ContractError, type Contract, type GaussianLayout } from '@gaussian-splat/core/contract';
import type { DynamicGaussians, Placed, Placement, World } from '@gaussian-splat/renderer';
import { Generator, type GaussianSink, type GeneratedFrame, type GeneratorOptions } from './generator.js';
import type { ModelSource } from './runtime/open-model.js';
import { receiveGaussians, type ThreeScene } from './scene-hosts.js';
import type { GeneratorState } from './state.js';

/** Makes what the Gaussians of a model are written into, for example `DynamicGaussians.create(device, layout)`. */
export type MakeSink<S extends GaussianSink> = (layout: GaussianLayout, contract: Contract) => S | Promise<S>;

/** A model in the scene. */
export interface GaussianModel<S extends GaussianSink = GaussianSink> {
  /** The name that its generator is registered with. */
  readonly name: string;
  readonly generator: Generator;
  /** What is drawn. */
  readonly gaussians: S;
  /** State of this model alone, on top of what `runGenerators` is given. */
  state: GeneratorState;
  /** Where it stands in a `World`; undefined elsewhere. */
  readonly placement: Placement | undefined;
  /** Takes it out of the scene. A sink that the page made belongs to the page; one that was made for a scene is destroyed. */
  remove(): void;
}

/** Where a model goes: a world, a scene of three.js, or what makes a sink. */
export type GaussianModelScene<S extends GaussianSink = GaussianSink> = World | ThreeScene | MakeSink<S>;

/** Gives the inputs of a model for the next run, or nothing to leave them as they are. */
export type FrameUpdate = (state: GeneratorState, model: GaussianModel) => GeneratorState | undefined | void;

/** The Gaussians of a model, with what only those in a scene have. */
type Hosted = Pick<GaussianModel, 'gaussians'> & Partial<Pick<GaussianModel, 'placement' | 'remove'>>;

/** A generator by its name. */
interface Registered {
  readonly source: ModelSource;
  readonly after: string | undefined;
}

/** Generators by name, and the models that show them: what a page of several generators keeps. */
export class GaussianModels {
  readonly #sources = new Map<string, Registered>();
  readonly #models = new Set<GaussianModel>();
  readonly #updates = new Set<FrameUpdate>();
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
   * Puts a model into a scene. Models of one generator share its session.
   *
   * ```ts
   * await models.addGaussianModelToScene('ball', world, { sceneToWorld }); // drawn by each Viewpoint of the world
   * await models.addGaussianModelToScene('ball', scene); // of three.js, drawn by a SplatRenderer
   * await models.addGaussianModelToScene('ball', (layout) => DynamicGaussians.create(device, layout)); // a sink of your own
   * ```
   * @param placed how it stands in a world.
   * @throws GaussianSplatError `argument/value` for a name that is not registered, before {@link loadAllGenerators}, or for a scene that no
   * renderer draws; what `makeSink` throws; an `AbortError` if {@link clear} is called meanwhile: a sink that `makeSink` has made then stays
   * with its maker.
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
   * Calls `update` before each run of each model. What it returns is laid over the state that {@link runGenerators} was given.
   *
   * ```ts
   * models.onFrame(({ timeSeconds = 0 }) => ({ controls: { swing: Math.sin(timeSeconds) } }));
   * ```
   * @returns what ends it.
   */
  onFrame(update: FrameUpdate): () => void {
    this.#updates.add(update);
    return () => this.#updates.delete(update);
  }

  /** Calls `listener` with each finished run of each model, and `onError` with runs that fail. @returns what ends it. */
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
   * Asks all models for the Gaussians of a state, laid over by what the callbacks of {@link onFrame} return, and by each model's own `state`.
   * Returns at once.
   * @throws GaussianSplatError `argument/value` if a state does not fit a contract.
   */
  runGenerators(state: GeneratorState = {}): void {
    for (const model of this.#models) {
      let asked = state;
      for (const update of this.#updates) asked = merged(asked, update(asked, model) ?? {});
      requireControls(model);
      model.generator.request(merged(asked, model.state));
    }
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

/** Controls and images of both, by their names; of everything else the second. */
function merged(state: GeneratorState, over: GeneratorState): GeneratorState {
  const { controls, pictures } = state;
  return {
    ...state,
    ...over,
    ...(controls && over.controls ? { controls: { ...controls, ...over.controls } } : {}),
    ...(pictures && over.pictures ? { pictures: { ...pictures, ...over.pictures } } : {}),
  };
}

/** Controls of a model alone must be its own; those of all models may belong to another. */
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

/** The page's own. */
const page = new GaussianModels();

/** {@link GaussianModels.registerGaussianGenerator} of the page. */
export const registerGaussianGenerator: GaussianModels['registerGaussianGenerator'] = (name, source, options) =>
  page.registerGaussianGenerator(name, source, options);
/** {@link GaussianModels.loadAllGenerators} of the page. */
export const loadAllGenerators: GaussianModels['loadAllGenerators'] = (device) => page.loadAllGenerators(device);
/** {@link GaussianModels.addGaussianModelToScene} of the page. */
export const addGaussianModelToScene: GaussianModels['addGaussianModelToScene'] =
  page.addGaussianModelToScene.bind(page);
/** {@link GaussianModels.onFrame} of the page. */
export const onFrame: GaussianModels['onFrame'] = (update) => page.onFrame(update);
/** {@link GaussianModels.onGenerated} of the page. */
export const onGenerated: GaussianModels['onGenerated'] = (listener, onError) => page.onGenerated(listener, onError);
/** {@link GaussianModels.runGenerators} of the page. */
export const runGenerators: GaussianModels['runGenerators'] = (state) => page.runGenerators(state);
