import { BUFFER_USAGE } from './kernel.js';

/** A range of a buffer to read. */
export interface ReadPart {
  readonly buffer: GPUBuffer;
  /** Offset of the range from the beginning of the buffer in bytes; default 0. */
  readonly byteOffset?: number;
  /** Length of the range in bytes; default: all bytes of the buffer. */
  readonly byteLength?: number;
}

/**
 * Reads ranges of buffers back in one submission, and resolves to a copy of each. Rejects if the device is lost
 * meanwhile.
 * @param encoder Encoder with the commands that write the buffers; default: a new one.
 */
export async function readBack(
  device: GPUDevice,
  parts: readonly ReadPart[],
  encoder?: GPUCommandEncoder,
): Promise<ArrayBuffer[]> {
  return readBackWith(device, parts, (mapped) => mapped.slice(0), encoder);
}

/**
 * Reads ranges of buffers back in one submission, for callers that copy the bytes elsewhere. Rejects if the device is
 * lost meanwhile.
 * @param take Called with the bytes of each range, which are valid until the function returns.
 * @returns The results of `take`, in the order of `parts`.
 */
export async function readBackWith<Taken>(
  device: GPUDevice,
  parts: readonly ReadPart[],
  take: (mapped: ArrayBuffer) => Taken,
  encoder = device.createCommandEncoder({ label: 'gs.read_back' }),
): Promise<Taken[]> {
  const { mapRead, copyDestination } = BUFFER_USAGE;
  const staged = parts.map(({ buffer, byteOffset = 0, byteLength = buffer.size }) => {
    const staging = device.createBuffer({
      label: 'gs.read_back',
      size: byteLength,
      usage: mapRead | copyDestination,
    });
    encoder.copyBufferToBuffer(buffer, byteOffset, staging, 0, byteLength);
    return staging;
  });
  device.queue.submit([encoder.finish()]);
  try {
    return await Promise.all(
      staged.map(async (staging) => {
        await staging.mapAsync(0x1);
        return take(staging.getMappedRange());
      }),
    );
  } finally {
    for (const staging of staged) staging.destroy();
  }
}
