import { BUFFER_USAGE } from './kernel.js';

/** A range of a buffer to read. */
export interface ReadPart {
  readonly buffer: GPUBuffer;
  /** Offset from the start of the buffer, default 0, and length, default all, in bytes. */
  readonly byteOffset?: number;
  readonly byteLength?: number;
}

/**
 * Reads buffers back, in one submission. Rejects if the device is lost meanwhile.
 * @param encoder Contains the commands that write the buffers; default: a new one.
 */
export async function readBack(
  device: GPUDevice,
  parts: readonly ReadPart[],
  encoder?: GPUCommandEncoder,
): Promise<ArrayBuffer[]> {
  return readBackWith(device, parts, (mapped) => mapped.slice(0), encoder);
}

/**
 * The same, for callers that copy the bytes elsewhere.
 * @param take Is called with the bytes of each range, which are valid until it returns.
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
