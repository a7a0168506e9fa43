import type { Contract, GaussianLayout, OnnxHeader } from '@gaussian-splat/core';
import { elementsOf } from '../input-value.js';

/** An output that is asked for. */
export interface ModelOutput {
  readonly name: string;
  readonly kind: 'gaussians' | 'count' | 'image';
  readonly dtype: 'float32' | 'float16' | 'int32';
  /** Elements that a run writes at most; undefined for a picture whose size only the run tells. */
  readonly most: number | undefined;
}

/** The outputs that a contract names. @param layout of the Gaussians, if the model writes any */
export function modelOutputs(
  header: OnnxHeader,
  { outputs }: Contract,
  layout: GaussianLayout | undefined,
): ModelOutput[] {
  if (outputs.layout === 'image') return [imageOutput(header, outputs.image)];
  const { attributes = [], capacity = 0, dtype = 'float32', count } = layout ?? {};
  const strides = new Map(attributes.map(({ tensor, rowStride }) => [tensor, rowStride]));
  const found: ModelOutput[] = [...strides].map(([name, stride]) => {
    return { name, kind: 'gaussians', dtype, most: capacity * stride };
  });
  if (count !== undefined) found.push({ name: count, kind: 'count', dtype: 'int32', most: 1 });
  return found;
}

function imageOutput(header: OnnxHeader, name: string): ModelOutput {
  const { dtype, dims } = header.outputs.find((output) => output.name === name)!;
  const isFixed = dims?.every((dim) => typeof dim === 'number') ?? false;
  const most = isFixed ? elementsOf((dims ?? []) as number[]) : undefined;
  return { name, kind: 'image', dtype: dtype as 'float32' | 'float16', most };
}
