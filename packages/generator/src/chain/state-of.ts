import type { StateInput } from '@gaussian-splat/core/contract';
import type { GpuTensor } from '../input-value.js';
import type { GeneratorModel } from '../runtime/open-model.js';
import { HandOver } from './hand-over.js';

/** State of one model: outputs of a run that are inputs of the next run. */
export class StateOf extends HandOver {
  readonly #model: GeneratorModel;

  private constructor(model: GeneratorModel, device: GPUDevice) {
    const connections = statesOf(model).map(([input, { output }]) => ({ input, output }));
    super(device, model, connections);
    this.#model = model;
    this.reset();
  }

  /** Returns the state of a model; undefined for a model without state. */
  static of(model: GeneratorModel, device: GPUDevice): StateOf | undefined {
    return statesOf(model).length > 0 ? new StateOf(model, device) : undefined;
  }

  /** Fills each state tensor with the default that the contract declares, or 0. */
  reset(): void {
    const { header } = this.#model;
    for (const [name, { default: value = 0 }] of statesOf(this.#model)) {
      const { dtype, dims } = header.inputs.find((input) => input.name === name)!;
      this.fill(name, { dtype: dtype as GpuTensor['dtype'], dims: dims as number[] }, value);
    }
  }
}

const statesOf = ({ contract }: GeneratorModel): [name: string, binding: StateInput][] =>
  Object.entries(contract.inputs).filter((entry): entry is [string, StateInput] => entry[1].role === 'state');
