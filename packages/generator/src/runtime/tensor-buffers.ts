/** Sizes, usages and read-back of GPU buffers for tensors. */

/** Bytes of one element by element type. */
export const ELEMENT_BYTES: Readonly<Record<string, number>> = { float32: 4, int32: 4, float16: 2, int64: 8 };

/** Returns the size in bytes of a GPU buffer for a tensor: a multiple of 16, because the runtime copies in such units. */
export function bufferBytes(dtype: string, elements: number): number {
  return Math.max(16, Math.ceil((elements * ELEMENT_BYTES[dtype]) / 16) * 16);
}

/**
 * Usage of GPU buffers for tensors: STORAGE, COPY_SRC and COPY_DST. `GPUBufferUsage` is undefined if a module is
 * imported outside a browser.
 */
export const TENSOR_USAGE = 0x80 | 0x4 | 0x8;

/** A range of a buffer in bytes. Offset and size are multiples of 4. */
export interface TensorPart {
  readonly buffer: GPUBuffer;
  /** Offset of the range. Default 0. */
  readonly offset?: number;
  readonly size: number;
}

/** Reads ranges of buffers back from the GPU, copied in one submission. For checks, never for frames. */
export async function readTensors(device: GPUDevice, parts: readonly TensorPart[]): Promise<Uint8Array[]> {
  const encoder = device.createCommandEncoder({ label: 'gs.generator.read' });
  // The usage is MAP_READ and COPY_DST.
  const staging = parts.map(({ size }) =>
    device.createBuffer({ label: 'gs.generator.read', size: Math.max(4, size), usage: 0x1 | 0x8 }),
  );
  parts.forEach(({ buffer, offset = 0, size }, i) => encoder.copyBufferToBuffer(buffer, offset, staging[i], 0, size));
  device.queue.submit([encoder.finish()]);
  try {
    await Promise.all(staging.map((buffer) => buffer.mapAsync(0x1)));
    return staging.map((buffer) => new Uint8Array(buffer.getMappedRange().slice(0)));
  } finally {
    for (const buffer of staging) buffer.destroy();
  }
}
