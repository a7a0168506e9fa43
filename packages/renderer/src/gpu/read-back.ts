import { BUFFER_USAGE } from './kernel.js';

/** A part of a buffer to read. */
export interface ReadPart {
  readonly buffer: GPUBuffer;
  /** Bytes from the beginning of the buffer, default 0, and how many, default all. */
  readonly byteOffset?: number;
  readonly byteLength?: number;
}

/**
 * Reads buffers back, in one submission. Rejects if the device is lost meanwhile.
 * @param encoder has recorded what writes the buffers; default: a new one
 */
export async function readBack(
  device: GPUDevice,
  parts: readonly ReadPart[],
  encoder?: GPUCommandEncoder,
): Promise<ArrayBuffer[]> {
  return readBackWith(device, parts, (mapped) => mapped.slice(0), encoder);
}

/**
 * The same, for those who put the bytes elsewhere.
 * @param take is given the bytes of each part, which are gone when it has returned
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
