import type { StateInput } from '@gaussian-splat/core/contract';
import type { GpuTensor, Inputs } from '../input-value.js';
import type { RunOutputs } from '../runtime/ort-session.js';
import type { GeneratorModel } from '../runtime/open-model.js';
import { HandOver } from './hand-over.js';

/** State of one model: outputs of a run that are inputs of the next run. */
export class StateOf {
  readonly #model: GeneratorModel;
  readonly #kept: HandOver;

  private constructor(model: GeneratorModel, device: GPUDevice) {
    this.#model = model;
    const connections = statesOf(model).map(([input, { output }]) => ({ input, output }));
    this.#kept = new HandOver(device, model, connections);
    this.reset();
  }

  /** Returns the state of a model; undefined for a model without state. */
  static of(model: GeneratorModel, device: GPUDevice): StateOf | undefined {
    return statesOf(model).length > 0 ? new StateOf(model, device) : undefined;
  }

  /** Outputs of the last run, by the names of the inputs that they become. */
  get tensors(): Inputs {
    return this.#kept.tensors;
  }

  /** Fills each state tensor with the default that the contract declares, or 0. */
  reset(): void {
    const { header } = this.#model;
    for (const [name, { default: value = 0 }] of statesOf(this.#model)) {
      const { dtype, dims } = header.inputs.find((input) => input.name === name)!;
      this.#kept.fill(name, { dtype: dtype as GpuTensor['dtype'], dims: dims as number[] }, value);
    }
  }

  /** Copies the state outputs of a run for the next run. */
  take(outputs: RunOutputs): void {
    this.#kept.take(outputs);
  }

  destroy(): void {
    this.#kept.destroy();
  }
}

const statesOf = ({ contract }: GeneratorModel): [name: string, binding: StateInput][] =>
  Object.entries(contract.inputs).filter((entry): entry is [string, StateInput] => entry[1].role === 'state');
