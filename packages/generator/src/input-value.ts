/** Numbers of one input in CPU memory, in the layout of its tensor. */
export interface InputNumbers {
  readonly dtype: 'float32' | 'int32' | 'int64';
  readonly dims: readonly number[];
  readonly data: Float32Array | Int32Array | BigInt64Array;
}

/** A tensor on the GPU: an image, or the output of another model. */
export interface GpuTensor {
  /** Buffer with the elements without gaps, two float16 per 32-bit word. Its usage must include COPY_SRC. */
  readonly buffer: GPUBuffer;
  readonly dtype: 'float32' | 'float16' | 'int32';
  readonly dims: readonly number[];
  /** Number that changes whenever the content changes, so that a run can detect new content. */
  readonly version: number;
}

/** Value of one input. */
export type InputValue = InputNumbers | GpuTensor;

/** Values of inputs by input name. */
export type Inputs = Readonly<Record<string, InputValue>>;

export const isOnGpu = (value: InputValue): value is GpuTensor => 'buffer' in value;

/** Returns the number of elements of a tensor with these dimensions. */
export const elementsOf = (dims: readonly number[]): number => dims.reduce((product, dim) => product * dim, 1);

/**
 * Whether two sets of values are equal, bit for bit. A generator without a seed would then write the same output again.
 */
export function sameInputs(a: Inputs, b: Inputs): boolean {
  const names = Object.keys(a);
  return (
    names.length === Object.keys(b).length && names.every((name) => Object.hasOwn(b, name) && same(a[name], b[name]))
  );
}

function same(a: InputValue, b: InputValue): boolean {
  if (a.dtype !== b.dtype || a.dims.length !== b.dims.length || a.dims.some((dim, i) => dim !== b.dims[i]))
    return false;
  if (isOnGpu(a) || isOnGpu(b)) return isOnGpu(a) && isOnGpu(b) && a.buffer === b.buffer && a.version === b.version;
  for (let i = 0; i < a.data.length; i++) if (!Object.is(a.data[i], b.data[i])) return false;
  return a.data.length === b.data.length;
}
