import type { InputBinding } from '@gaussian-splat/core/contract';
import type { GeneratorModel } from '@gaussian-splat/generator';

/**
 * An input of a model that a page may set, as its contract declares it. The description suffices to create controls for
 * visitors.
 */
export interface GeneratorInput {
  /** Name of the input, as in `inputValues` and `control-NAME`. */
  readonly name: string;
  /**
   * Kind of the input. `control`, `shape`, `seed` and `image` are set by `control-NAME` or `inputValues`, `pose` by
   * `pose`, `time` and `frame` by `currentTime`. The element itself sets others, such as `view`.
   */
  readonly role: Exclude<InputBinding['role'], 'gaussians' | 'depth' | 'state'>;
  /** Name for visitors; default: {@link name}. */
  readonly label: string;
  /** Number of elements of the tensor; 0 for an image. */
  readonly size: number;
  /** Allowed range of each element, inclusive. */
  readonly range?: readonly [min: number, max: number];
  readonly step?: number;
  /** Default value: all elements, or one number for all of them. */
  readonly default?: number | readonly number[];
  /** Format of the joint rotations of a pose. */
  readonly format?: 'axis-angle' | 'quaternion' | 'matrix' | 'parameters';
  readonly quaternionOrder?: 'wxyz' | 'xyzw';
  readonly joints?: readonly string[];
  /** Index of the parent of each joint; -1 for roots. */
  readonly parents?: readonly number[];
  /** Names of the elements, for example of the coefficients of a shape. */
  readonly names?: readonly string[];
  /** Number of images that the tensor of an image input contains; absent for 1. */
  readonly views?: number;
}

/**
 * Returns the inputs of the models of a chain. If several models have an input of the same name, the first one counts.
 */
export function inputsOf(models: readonly GeneratorModel[]): readonly GeneratorInput[] {
  const found = new Map<string, GeneratorInput>();
  for (const { header, contract } of models) {
    for (const { name, dims = [], dtype } of header.inputs) {
      const { role, ...details } = contract.inputs[name];
      if (role === 'gaussians' || role === 'depth' || role === 'state' || found.has(name)) continue;
      const numbers = dims.filter((dim) => typeof dim === 'number');
      const views = role === 'image' ? numbers.slice(0, -3).reduce((product, dim) => product * dim, 1) : undefined;
      found.set(name, {
        label: name,
        ...(dtype !== 'float32' && role === 'control' ? { step: 1 } : {}),
        ...(details as Partial<GeneratorInput>),
        ...(views !== undefined && views > 1 ? { views } : {}),
        name,
        role,
        size: role === 'image' ? 0 : numbers.reduce((product, dim) => product * dim, 1),
      });
    }
  }
  return [...found.values()];
}
