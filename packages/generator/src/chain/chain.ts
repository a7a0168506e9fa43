import { ContractError, type ContractFault } from '@gaussian-splat/core/contract';
import { sameInputs, type Inputs } from '../input-value.js';
import type { GeneratorSession } from '../runtime/generator-session.js';
import type { RunOutputs, SessionKind } from '../runtime/ort-session.js';
import type { GeneratorModel, ModelSource } from '../runtime/open-model.js';
import { acquireSession, type AcquireOptions, type SessionLease } from '../runtime/shared-sessions.js';
import { watchRuntimeBytes } from '../runtime/runtime-progress.js';
import { sumProgress } from '../runtime/fetch-bytes.js';
import type { GeneratorState } from '../state.js';
import { connect } from './connect.js';
import { HandOver } from './hand-over.js';
import { StateOf } from './state-of.js';

/** One model, or several models that run in sequence: the outputs of each are inputs of the next. */
export class Chain {
  readonly device: GPUDevice;
  readonly #leases: readonly SessionLease[];
  readonly #handOvers: readonly HandOver[];
  /** State tensors of each model between runs; undefined for a model without state. */
  readonly #states: readonly (StateOf | undefined)[];
  /** Inputs from the page in each model's last run. A missing element means that the model must run again. */
  readonly #ran: (Inputs | undefined)[] = [];
  readonly #endProgress: () => void;
  /** Gaussians for the first model, from a generator that is not part of the chain. */
  #before: HandOver | undefined;

  private constructor(leases: readonly SessionLease[], device: GPUDevice, endProgress: () => void) {
    this.device = device;
    this.#leases = leases;
    this.#endProgress = endProgress;
    const models = leases.map(({ session }) => session.model);
    if (models.length > 1) requireNoInstances(models);
    this.#handOvers = models.slice(1).map((after, i) => new HandOver(device, models[i], connect(models[i], after)));
    this.#states = models.map((model) => StateOf.of(model, device));
  }

  /**
   * Fetches all models and checks them, individually and as a chain. The runtime is not fetched yet.
   * @throws ContractError, GaussianSplatError: see `openModel`; ContractError `contract/chain` if the models do not
   * match.
   */
  static async open(
    sources: ModelSource | readonly ModelSource[],
    device: GPUDevice,
    options: AcquireOptions,
  ): Promise<Chain> {
    const list = Array.isArray(sources) ? (sources as readonly ModelSource[]) : [sources as ModelSource];
    const reports = sumProgress(list.length + 1, options.onProgress ?? ignore);
    const endProgress = watchRuntimeBytes(reports[list.length]);
    const opening = list.map(async (source, i) => {
      const lease = await acquireSession(source, device, { ...options, onProgress: reports[i] });
      // Reports the whole size, because another generator may have fetched the model, or may be fetching it.
      const { bytes, externalData } = lease.session.model;
      const size = externalData.reduce((sum, { data }) => sum + data.length, bytes.length);
      reports[i](size, size);
      return lease;
    });
    try {
      return new Chain(await Promise.all(opening), device, endProgress);
    } catch (error) {
      endProgress();
      for (const lease of opening) lease.then(({ release }) => release(), ignore);
      throw error;
    }
  }

  /**
   * Session of a single model that computes several instances in one run; undefined for a chain and for all other
   * models.
   */
  get ofInstances(): GeneratorSession | undefined {
    const [{ session }] = this.#leases;
    return session.model.contract.instances && session;
  }

  /** Models in execution order. */
  get models(): readonly GeneratorModel[] {
    return this.#leases.map(({ session }) => session.model);
  }

  /** Slowest session kind of all models; undefined before the first run. */
  get kind(): SessionKind | undefined {
    const kinds = this.#leases.map(({ session }) => session.kind);
    return SLOWEST_FIRST.find((kind) => kinds.includes(kind));
  }

  /** Whether the first model takes Gaussians of another one: see {@link follow}. */
  get takesGaussians(): boolean {
    return this.models[0].header.inputs.some(({ name }) => this.models[0].contract.inputs[name].role === 'gaussians');
  }

  /** Whether the last run of the generator that the chain follows has written rows. */
  get hasGaussians(): boolean {
    return (this.#before?.rows ?? 0) > 0;
  }

  /**
   * Makes a generator the source of the Gaussians that the first model takes.
   * @returns Takes the outputs of the generator's runs, instead of the one that an earlier call has returned.
   * @throws ContractError `contract/chain` if the models do not match, or the generator declares instances.
   */
  follow(model: GeneratorModel): HandOver {
    requireNoInstances([model]);
    return (this.#before = new HandOver(this.device, model, connect(model, this.models[0])));
  }

  /** Returns the inputs of every model for a state of the page. @throws GaussianSplatError `argument/value` */
  bind(state: GeneratorState): readonly Inputs[] {
    return this.#leases.map(({ session }, i) => ({
      ...session.bind(state, this.#handOvers[i - 1]?.inputs),
      ...(i === 0 && this.#before?.tensors),
    }));
  }

  /** Resets the state tensors of all models to their defaults. */
  restart(): void {
    for (const state of this.#states) state?.reset();
  }

  /**
   * Runs the first model whose inputs differ from those of its last run, and all models after it; without a difference,
   * all models. Calls `use` with the outputs of the last model, or with empty outputs if an earlier model has no rows.
   * @throws the errors of `GeneratorSession.run`
   */
  async run(inputs: readonly Inputs[], use: (outputs: RunOutputs) => void): Promise<void> {
    const changed = inputs.findIndex((values, i) => !this.#ran[i] || !sameInputs(values, this.#ran[i]));
    const last = this.#leases.length - 1;
    for (let i = Math.min(last, Math.max(0, changed)); i <= last; i++) {
      const before = this.#handOvers[i - 1] as HandOver | undefined;
      if (before?.rows === 0) return use({ tensors: {}, dims: {}, rows: 0 });
      this.#ran.length = i;
      const take = i === last ? use : (outputs: RunOutputs) => this.#handOvers[i].take(outputs);
      const state = this.#states[i];
      await this.#session(i).run({ ...inputs[i], ...before?.tensors, ...state?.tensors }, (outputs) => {
        take(outputs);
        state?.take(outputs);
      });
      this.#ran[i] = inputs[i];
    }
  }

  /** Invalidates the outputs of all models, so that the next run executes all of them. */
  forget(): void {
    this.#ran.length = 0;
  }

  /**
   * Releases all models.
   * @param idle Promise that fulfills when the last run has ended, which may read the intermediate tensors until then.
   */
  release(idle: Promise<void> = Promise.resolve()): void {
    this.#endProgress();
    for (const { release } of this.#leases) release();
    void idle.then(() => [...this.#handOvers, ...this.#states, this.#before].forEach((kept) => kept?.destroy()));
  }

  #session(i: number): GeneratorSession {
    return this.#leases[i].session;
  }
}

const SLOWEST_FIRST: readonly SessionKind[] = ['wasm', 'webgpu', 'captured'];

/**
 * Requires that the first model of a chain has no inputs for another model's Gaussians.
 * @throws ContractError `contract/chain`
 */
export function requireNoneBefore({ header, contract }: GeneratorModel): void {
  const faults = header.inputs
    .filter(({ name }) => contract.inputs[name].role === 'gaussians')
    .map(({ name }): ContractFault => {
      return {
        code: 'contract/chain',
        tensor: name,
        where: `input ${name} of ${header.name}`,
        expected: 'a model before this one, whose Gaussians the input takes',
        found: 'none',
        remedy: 'open both as a chain, the one that makes Gaussians first; a post-processor follows a generator',
      };
    });
  if (faults.length > 0) throw new ContractError(faults);
}

/**
 * Requires that no model of a chain declares instances, because intermediate tensors are those of one instance.
 * @throws ContractError `contract/chain`
 */
function requireNoInstances(models: readonly GeneratorModel[]): void {
  const faults = models
    .filter(({ contract }) => contract.instances !== undefined)
    .map(({ header }): ContractFault => {
      return {
        code: 'contract/chain',
        where: header.name,
        expected: 'models of one instance, in a chain of several',
        found: 'a model that declares instances',
        remedy: 'export it without that axis for the chain',
      };
    });
  if (faults.length > 0) throw new ContractError(faults);
}

function ignore(): void {
  // The relevant failure has already been thrown.
}
