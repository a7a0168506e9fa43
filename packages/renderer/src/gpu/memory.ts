import { GaussianSplatError } from '@gaussian-splat/core';
import { MemoryLedger, type Reservation } from '../memory-ledger.js';

/**
 * Minimum size of a buffer in bytes. A binding must contain at least one element of its array, even for an empty scene.
 */
const SMALLEST_BUFFER = 64;

/**
 * GPU buffers with one owner. This class counts their bytes, checks the limits of the device, and destroys all of them
 * together.
 */
export class GpuMemory {
  readonly #device: GPUDevice;
  readonly #buffers = new Map<GPUBuffer, number>();
  #reservation: Reservation | undefined;

  constructor(device: GPUDevice) {
    this.#device = device;
  }

  /** Number of bytes of all buffers that are not destroyed. */
  get byteLength(): number {
    let total = 0;
    for (const size of this.#buffers.values()) total += size;
    return total;
  }

  /**
   * Creates a buffer, whose size is rounded up to 4 bytes and to {@link SMALLEST_BUFFER}.
   * @param content Initial content; undefined for zeros.
   * @throws GaussianSplatError `out-of-memory/buffer-limit` if the device does not allow a buffer of that size.
   */
  buffer(label: string, byteLength: number, usage: GPUBufferUsageFlags, content?: Uint32Array): GPUBuffer {
    const size = Math.max(SMALLEST_BUFFER, Math.ceil(byteLength / 4) * 4);
    requireBufferSize(this.#device, label, size);
    const buffer = this.#device.createBuffer({ label, size, usage, mappedAtCreation: content !== undefined });
    if (content !== undefined) {
      new Uint32Array(buffer.getMappedRange()).set(content);
      buffer.unmap();
    }
    this.#buffers.set(buffer, size);
    return buffer;
  }

  /** Reserves bytes of the device until {@link destroy}, with the parameters and errors of {@link MemoryLedger.reserve}. */
  reserve(...bytes: Parameters<MemoryLedger['reserve']>): void {
    this.#reservation = MemoryLedger.of(this.#device).reserve(...bytes);
  }

  free(buffer: GPUBuffer): void {
    if (this.#buffers.delete(buffer)) buffer.destroy();
  }

  destroy(): void {
    this.#reservation?.release();
    for (const buffer of this.#buffers.keys()) buffer.destroy();
    this.#buffers.clear();
  }
}

/** An owner of GPU buffers, which are destroyed with it. */
export abstract class BufferOwner {
  protected readonly memory: GpuMemory;

  constructor(memory: GpuMemory) {
    this.memory = memory;
  }

  /** Bytes of allocated GPU memory. */
  get byteLength(): number {
    return this.memory.byteLength;
  }

  destroy(): void {
    this.memory.destroy();
  }
}

function requireBufferSize(device: GPUDevice, label: string, size: number): void {
  const { maxBufferSize, maxStorageBufferBindingSize } = device.limits;
  const limit = Math.min(maxBufferSize, maxStorageBufferBindingSize);
  if (size <= limit) return;
  throw new GaussianSplatError('out-of-memory/buffer-limit', {
    where: `GPU buffer ${label}`,
    expected: `at most ${limit} bytes (maxBufferSize ${maxBufferSize}, maxStorageBufferBindingSize ${maxStorageBufferBindingSize})`,
    found: `${size} bytes`,
    remedy: "request the adapter's limits with deviceDescriptor(adapter), or show a smaller scene",
  });
}

/**
 * Runs `allocate`, waits until the device has confirmed the allocation, and resolves to its result. If anything fails,
 * the memory is destroyed.
 * @param where Name of the owner, for error messages.
 * @throws GaussianSplatError `out-of-memory/allocation` if the device has too little memory; errors of `allocate`.
 */
export async function withMemoryCheck<T extends { destroy(): void }>(
  device: GPUDevice,
  where: string,
  allocate: (memory: GpuMemory) => T,
): Promise<T> {
  device.pushErrorScope('out-of-memory');
  const memory = new GpuMemory(device);
  let made: T | undefined;
  let thrown: unknown;
  try {
    made = allocate(memory);
  } catch (error) {
    thrown = error;
  }
  const refusal = await device.popErrorScope();
  if (made !== undefined && refusal === null) return made;
  (made ?? memory).destroy();
  if (thrown instanceof GaussianSplatError) throw thrown;
  throw new GaussianSplatError('out-of-memory/allocation', {
    where,
    expected: 'enough free GPU memory',
    found: refusal?.message ?? String(thrown),
    remedy: 'show a smaller scene, or close other pages and elements that use the GPU',
    cause: refusal ?? thrown,
  });
}
