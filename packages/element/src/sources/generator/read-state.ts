import { GaussianSplatError, type Camera } from '@gaussian-splat/core';
import type { Contract, ControlInput, InputBinding } from '@gaussian-splat/core/contract';
import type { GeneratorModel, GeneratorState, GpuTensor } from '@gaussian-splat/generator';
import type { DynamicState } from './dynamic-model.js';
import { valueOf } from './values.js';

/** Allowed range of a seed, which models receive as int32 or int64. */
const INT32 = [-(2 ** 31), 2 ** 31 - 1] as const;

/** Roles of inputs whose numbers `control-NAME` sets. */
const NUMBERS: readonly string[] = ['control', 'pose', 'shape', 'seed'];

/**
 * Converts the state that the page sets to the state of a generator. Invalid values are corrected, and each is reported
 * once.
 */
export class StateReader {
  readonly #inputs: Contract['inputs'];
  readonly #report: (error: GaussianSplatError) => void;
  readonly #reported = new Set<string>();

  /**
   * @param models Models whose inputs the page may set.
   * @param report Receives the error for each invalid value, with code `argument/value`.
   */
  constructor(models: readonly GeneratorModel[], report: (error: GaussianSplatError) => void) {
    this.#inputs = merged(models.map(({ contract }) => contract.inputs));
    this.#report = report;
  }

  /**
   * Returns the state of a run.
   * @param images Tensors of image inputs, by name.
   * @param others Names of inputs of other models, which are not reported as unknown; null if another model reports
   * unknown names.
   */
  read(
    state: DynamicState,
    camera: Camera,
    images: Readonly<Record<string, GpuTensor>>,
    others: readonly string[] | null,
  ): GeneratorState {
    const { timeSeconds, pose } = state;
    const controls: Record<string, number | readonly number[]> = {};
    let seed: number | undefined;
    for (const [name, binding] of Object.entries(this.#inputs)) {
      if (!NUMBERS.includes(binding.role)) continue;
      const value = valueOf(state.controls, name);
      const image = valueOf(state.images, name);
      if (image !== undefined) this.#notify(name, 'numbers', String(image).slice(0, 60), 'its default is used');
      if (value === undefined) continue;
      if (binding.role === 'seed') seed = this.#wholeNumber(name, value[0]);
      else controls[name] = binding.role === 'control' ? this.#inRange(name, binding, value) : value;
    }
    if (others) this.#reportUnknown([...Object.keys(state.controls), ...Object.keys(state.images)], others);
    return { timeSeconds, camera, pose, controls, seed, images };
  }

  #inRange(name: string, { range: [min, max] }: ControlInput, values: readonly number[]): number | readonly number[] {
    const inside = values.map((value) => Math.min(max, Math.max(min, value)));
    if (inside.some((value, i) => value !== values[i])) {
      this.#notify(name, `${min} to ${max}`, values.slice(0, 4).join(' '), 'the nearest value in this range is used');
    }
    return inside.length === 1 ? inside[0] : inside;
  }

  #wholeNumber(name: string, value: number): number {
    const [min, max] = INT32;
    const nearest = Math.min(max, Math.max(min, Math.round(value)));
    if (nearest !== value)
      this.#notify(name, `a whole number from ${min} to ${max}`, String(value), 'the nearest one is used');
    return nearest;
  }

  /** Names of the inputs that `control-NAME` sets. */
  get settable(): readonly string[] {
    return Object.keys(this.#inputs).filter((name) => [...NUMBERS, 'image'].includes(this.#inputs[name].role));
  }

  #reportUnknown(names: readonly string[], others: readonly string[]): void {
    const known = [...this.settable, ...others];
    for (const name of names) {
      if (known.some((input) => input === name || input.toLowerCase() === name)) continue;
      const expected = known.length > 0 ? `one of the inputs ${known.join(', ')}` : 'no control: the model has none';
      this.#notify(name, expected, 'a name that no input has', 'correct the name, or leave it out');
    }
  }

  /** Reports a pose if no model has an input for it. */
  checkPose({ pose }: DynamicState): void {
    if (pose === undefined || Object.values(this.#inputs).some(({ role }) => role === 'pose')) return;
    this.#say('pose', 'none: the model takes no pose', `${pose.length} numbers`, 'leave it out');
  }

  #notify(name: string, expected: string, found: string, remedy: string): void {
    this.#say(`control ${name}`, expected, found, remedy);
  }

  #say(where: string, expected: string, found: string, remedy: string): void {
    const error = new GaussianSplatError('argument/value', { where, expected, found, remedy });
    if (this.#reported.has(error.message)) return;
    this.#reported.add(error.message);
    this.#report(error);
  }
}

/**
 * Merges the inputs of several models. Controls of the same name become one control, whose range is the intersection of
 * their ranges.
 */
function merged(models: readonly Contract['inputs'][]): Contract['inputs'] {
  const inputs: Record<string, InputBinding> = {};
  for (const [name, binding] of models.flatMap(Object.entries<InputBinding>)) {
    const known = Object.hasOwn(inputs, name) ? inputs[name] : undefined;
    if (known?.role !== 'control') inputs[name] = binding;
    else if (binding.role === 'control') inputs[name] = { ...known, range: common(known.range, binding.range) };
  }
  return inputs;
}

const common = ([a, b]: ControlInput['range'], [c, d]: ControlInput['range']): ControlInput['range'] => [
  Math.max(a, c),
  Math.min(b, d),
];
