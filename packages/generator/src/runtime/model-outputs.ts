import type { Contract, GaussianLayout } from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import { elementsOf } from '../input-value.js';

/** An output that each run requests, unless it is constant. */
export interface ModelOutput {
  readonly name: string;
  readonly kind: 'gaussians' | 'count' | 'image' | 'state';
  readonly dtype: 'float32' | 'float16' | 'int32' | 'int64';
  /** Number of elements in each row of Gaussians; undefined for other outputs. */
  readonly rowElements?: number;
  /** Maximum number of elements in a run; undefined for an image whose size only a run determines. */
  readonly max: number | undefined;
}

/**
 * Returns the outputs that a contract names, each once.
 * @param layout Layout of the Gaussians; undefined for a model that writes an image.
 */
export function modelOutputs(
  header: OnnxHeader,
  contract: Contract,
  layout: GaussianLayout | undefined,
): ModelOutput[] {
  const written = writtenOutputs(header, contract, layout);
  const states = Object.values(contract.inputs).flatMap((input): ModelOutput[] => {
    if (input.role !== 'state' || written.some(({ name }) => name === input.output)) return [];
    const { dims, dtype } = header.outputs.find(({ name }) => name === input.output)!;
    return [
      { name: input.output, kind: 'state', dtype: dtype as ModelOutput['dtype'], max: elementsOf(dims as number[]) },
    ];
  });
  return [...written, ...states];
}

function writtenOutputs(header: OnnxHeader, { outputs }: Contract, layout: GaussianLayout | undefined): ModelOutput[] {
  if (outputs.layout === 'image') return [imageOutput(header, outputs.image)];
  const { attributes = [], capacity = 0, paddedRows = capacity, dtype = 'float32', count, countDtype } = layout ?? {};
  const strides = new Map(attributes.map(({ tensor, rowStride }) => [tensor, rowStride]));
  const found: ModelOutput[] = [...strides].map(([name, rowElements]) => {
    return { name, kind: 'gaussians', dtype, max: paddedRows * rowElements, rowElements };
  });
  if (count !== undefined) found.push({ name: count, kind: 'count', dtype: countDtype ?? 'int32', max: 1 });
  return found;
}

function imageOutput(header: OnnxHeader, name: string): ModelOutput {
  const { dtype, dims } = header.outputs.find((output) => output.name === name)!;
  const isFixed = dims?.every((dim) => typeof dim === 'number') ?? false;
  const max = isFixed ? elementsOf((dims ?? []) as number[]) : undefined;
  return { name, kind: 'image', dtype: dtype as 'float32' | 'float16', max };
}
