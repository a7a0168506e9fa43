import type { InputBinding } from '@gaussian-splat/core/contract';
import type { GeneratorModel } from '@gaussian-splat/generator';

/** An input of a model that a page may set, from its contract: enough to create controls for visitors. */
export interface GeneratorInput {
  /** Name as in `inputValues` and `control-NAME`. */
  readonly name: string;
  /**
   * `control`, `shape`, `seed`, `image`: set by `control-NAME` or `inputValues`; `pose`: by `pose`; `time`, `frame`: by
   * `currentTime`. Others, such as `view`, are set by the element itself.
   */
  readonly role: Exclude<InputBinding['role'], 'gaussians' | 'depth' | 'state'>;
  /** For readers. */
  readonly label: string;
  /** Number of its elements; 0 for an image. */
  readonly size: number;
  /** Range of each element. */
  readonly range?: readonly [min: number, max: number];
  readonly step?: number;
  /** Default: all elements, or one number for all. */
  readonly default?: number | readonly number[];
  /** Format of the rotations of a pose. */
  readonly format?: 'axis-angle' | 'quaternion' | 'matrix' | 'parameters';
  readonly quaternionOrder?: 'wxyz' | 'xyzw';
  readonly joints?: readonly string[];
  /** Index of the parent of each joint, -1 for roots. */
  readonly parents?: readonly number[];
  /** Names of the coefficients of a shape. */
  readonly names?: readonly string[];
  /** Number of images in one tensor, for an image. */
  readonly views?: number;
}

/** The inputs of models in a chain, each name once. */
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
