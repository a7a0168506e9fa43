import type { InputBinding } from '@gaussian-splat/core/contract';
import type { GeneratorModel } from '@gaussian-splat/generator';

/** What a page may set of a model, from its contract: enough to make controls for visitors. */
export interface GeneratorInput {
  /** As in `inputValues` and `control-NAME`. */
  readonly name: string;
  /**
   * `control`, `shape`, `image`: set by `control-NAME` or `inputValues`; `pose`: by `pose`; `time`, `frame`: by `currentTime`. Others, such as `view`, are fed by the
   * element itself.
   */
  readonly role: Exclude<InputBinding['role'], 'gaussians' | 'depth' | 'state'>;
  /** For readers. */
  readonly label: string;
  /** Numbers that it takes; of an image 0. */
  readonly size: number;
  /** Of each number. */
  readonly range?: readonly [min: number, max: number];
  readonly step?: number;
  /** Where nothing is set: all numbers, or one for all. */
  readonly default?: number | readonly number[];
  /** Of a pose. */
  readonly format?: 'axis-angle' | 'quaternion' | 'matrix' | 'parameters';
  readonly quaternionOrder?: 'wxyz' | 'xyzw';
  readonly joints?: readonly string[];
  /** For each joint the index of its parent, -1 for roots. */
  readonly parents?: readonly number[];
  /** Of the coefficients of a shape. */
  readonly names?: readonly string[];
  /** Images that an image takes, in one tensor. */
  readonly views?: number;
}

/** The inputs of models that run one after the other, each name once. */
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
