import { GraphValues } from './graph-values.js';
import type { OnnxDtype, OnnxHeader } from './header.js';

/** Memory of a model as its file declares it. A run needs more, because the runtime keeps several tensors at a time. */
export interface ModelMemory {
  /** Bytes of all weights and constants, including those in files beside the model. */
  readonly weightBytes: number;
  /**
   * Number of bytes of the largest tensor of known size that the nodes compute; null if no size is known. It is a lower
   * bound while `unknownTensors` is not 0.
   */
  readonly largestKnownTensorBytes: number | null;
  /** Number of computed tensors whose size only a run determines. */
  readonly unknownTensors: number;
}

/**
 * Number of bits of an element of each type. Strings and complex numbers are missing, because models of Gaussians do
 * not compute them.
 */
const BITS: Readonly<Partial<Record<OnnxDtype, number>>> = {
  ...{ float64: 64, int64: 64, uint64: 64, float32: 32, int32: 32, uint32: 32 },
  ...{ float16: 16, bfloat16: 16, int16: 16, uint16: 16, int8: 8, uint8: 8, bool: 8 },
  ...{ float8e4m3fn: 8, float8e4m3fnuz: 8, float8e5m2: 8, float8e5m2fnuz: 8, int4: 4, uint4: 4, float4e2m1: 4 },
};

/** Returns the memory of a model from its header, without its weights. */
export function modelMemory(header: OnnxHeader): ModelMemory {
  const values = new GraphValues(header);
  let weightBytes = 0;
  for (const { dtype, dims } of header.stored.values()) weightBytes += bytesOf(dtype, dims) ?? 0;
  let largestKnownTensorBytes: number | null = null;
  let unknownTensors = 0;
  for (const { operator, outputs, isInner, value } of header.nodes) {
    if (value) weightBytes += bytesOf(value.dtype, value.dims) ?? 0;
    // The output of a `Constant` is the constant itself. Other tensors that depend only on constants have memory of
    // their own.
    if (operator === 'Constant') continue;
    for (const name of outputs) {
      // Tensors of subgraphs and functions have a different shape in each call.
      if (name === '' || isInner) continue;
      const bytes = bytesOf(values.dtypeOf(name), values.dimsOf(name));
      if (bytes === undefined) unknownTensors++;
      else largestKnownTensorBytes = Math.max(largestKnownTensorBytes ?? 0, bytes);
    }
  }
  return { weightBytes, largestKnownTensorBytes, unknownTensors };
}

/** Returns the size of a tensor in bytes; undefined if its type or a dimension is unknown. */
function bytesOf(dtype: OnnxDtype | undefined, dims: readonly (number | null)[] | undefined): number | undefined {
  const bits = dtype && BITS[dtype];
  if (bits === undefined || dims === undefined) return undefined;
  let count = 1;
  for (const dim of dims) {
    if (dim === null || dim < 0) return undefined;
    count *= dim;
  }
  return Math.ceil((count * bits) / 8);
}
