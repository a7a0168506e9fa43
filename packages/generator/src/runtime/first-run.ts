import { elementsOf, isOnGpu, type GpuTensor, type Inputs } from '../input-value.js';
import type { Evidence } from '../cpu-check/prove.js';
import type { FixedOutput, RunOutputs } from './ort-session.js';
import type { GeneratorModel } from './open-model.js';
import { ELEMENT_BYTES, readTensors, TENSOR_USAGE } from './tensor-buffers.js';

/** Bytes of a compared range of an output. Several ranges are spread over a large output. */
const PIECE_BYTES = 65_536;
const MAX_PIECES = 8;

/** Dimensions of a run's outputs, and ranges of their content. */
export interface WrittenRun {
  readonly dims: Readonly<Record<string, readonly number[]>>;
  readonly parts: Evidence['parts'];
}

/** Reads ranges of a run's output back from the GPU. Data after the rows of a run is undefined and not read. */
export async function readRun(
  device: GPUDevice,
  { outputs }: GeneratorModel,
  { tensors, dims }: RunOutputs,
): Promise<WrittenRun> {
  const parts = outputs.flatMap(({ name: tensor, dtype }) => {
    const bytes = elementsOf(dims[tensor]) * ELEMENT_BYTES[dtype];
    // The buffer does not contain more rows than declared; such a run is rejected later.
    const size = Math.min(bytes - (bytes % 4), tensors[tensor].size);
    const pieces = Math.min(MAX_PIECES, Math.ceil(size / PIECE_BYTES));
    return Array.from({ length: Math.max(1, pieces) }, (_, i) => {
      const offset = pieces > 1 ? Math.floor(((size - PIECE_BYTES) * i) / (pieces - 1) / 4) * 4 : 0;
      // A 64-bit count is compared as two 32-bit integers.
      const compared = dtype === 'int64' ? ('int32' as const) : dtype;
      return { tensor, dtype: compared, offset, size: Math.min(PIECE_BYTES, size), buffer: tensors[tensor] };
    });
  });
  const read = await readTensors(device, parts);
  return {
    dims,
    parts: parts.map(({ tensor, dtype, offset, size }, i) => ({ tensor, dtype, offset, size, bytes: read[i] })),
  };
}

/** Whether two runs have the same output in the ranges that were read. */
export const isEqual = ({ parts: a }: WrittenRun, { parts: b }: WrittenRun): boolean =>
  a.length === b.length &&
  a.every(({ bytes }, i) => bytes.length === b[i].bytes.length && bytes.every((byte, k) => byte === b[i].bytes[k]));

/** Returns a run with its inputs, for a comparison in a worker. Reads inputs on the GPU back. */
export async function evidenceOf(device: GPUDevice, inputs: Inputs, { dims, parts }: WrittenRun): Promise<Evidence> {
  const feeds = await Promise.all(
    Object.entries(inputs).map(async ([name, value]) => {
      const { dtype, dims: size } = value;
      return [name, { dtype, dims: size, data: isOnGpu(value) ? await numbersOf(device, value) : value.data }] as const;
    }),
  );
  return { feeds: Object.fromEntries(feeds), dims, parts };
}

/** Reads the numbers of a tensor back from the GPU. Numbers of float16 are returned as their bits. */
export async function numbersOf(device: GPUDevice, input: GpuTensor): Promise<Float32Array | Int32Array | Uint16Array> {
  const { buffer, dtype, dims } = input;
  const length = elementsOf(dims);
  const size = Math.ceil((length * (dtype === 'float16' ? 2 : 4)) / 4) * 4;
  const [{ buffer: memory }] = await readTensors(device, [{ buffer, size }]);
  if (dtype === 'float16') return new Uint16Array(memory, 0, length);
  return dtype === 'int32' ? new Int32Array(memory, 0, length) : new Float32Array(memory, 0, length);
}

/** Returns a copy of an output that is the same in every run. */
export function copyOf(device: GPUDevice, name: string, { tensors, dims }: RunOutputs): FixedOutput {
  const { size } = tensors[name];
  const buffer = device.createBuffer({ label: `gs.generator.${name}`, size, usage: TENSOR_USAGE });
  const encoder = device.createCommandEncoder({ label: 'gs.generator.copy' });
  encoder.copyBufferToBuffer(tensors[name], 0, buffer, 0, size);
  device.queue.submit([encoder.finish()]);
  return { buffer, dims: dims[name] };
}
