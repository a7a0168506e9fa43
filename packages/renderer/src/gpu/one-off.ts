/** Uniforms and compute passes of work that frames do not repeat. */
import { BUFFER_USAGE } from './kernel.js';
import type { GpuMemory } from './memory.js';
import { writeStruct, type StructLayout, type StructValues } from './struct.js';

function bytesOf<L extends StructLayout>(layout: L, values: StructValues<L>): ArrayBuffer {
  const bytes = new ArrayBuffer(layout.size);
  writeStruct(layout, values, bytes);
  return bytes;
}

/** Allocates a uniform buffer with the values of a struct. */
export function uniformWith<L extends StructLayout>(
  memory: GpuMemory,
  label: string,
  layout: L,
  values: StructValues<L>,
): GPUBuffer {
  return memory.buffer(label, layout.size, BUFFER_USAGE.uniform, new Uint32Array(bytesOf(layout, values)));
}

/** Writes a struct to a uniform buffer, before the commands that are submitted later. */
export function writeUniform<L extends StructLayout>(
  device: GPUDevice,
  buffer: GPUBuffer,
  layout: L,
  values: StructValues<L>,
): void {
  device.queue.writeBuffer(buffer, 0, bytesOf(layout, values));
}

/**
 * Records a compute pass, and submits it.
 * @param encoder Encoder with the commands that precede the pass; default: a new one.
 */
export function submitPass(
  device: GPUDevice,
  label: string,
  record: (pass: GPUComputePassEncoder) => void,
  encoder = device.createCommandEncoder({ label }),
): void {
  const pass = encoder.beginComputePass({ label });
  record(pass);
  pass.end();
  device.queue.submit([encoder.finish()]);
}
