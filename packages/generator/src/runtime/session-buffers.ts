import { TENSOR_USAGE } from './tensor-buffers.js';

/** GPU buffers of one session, by name. They are replaced by larger ones if images or numbers of rows grow. */
export class SessionBuffers {
  readonly #device: GPUDevice;
  readonly #buffers = new Map<string, GPUBuffer>();

  constructor(device: GPUDevice) {
    this.#device = device;
  }

  /** Returns the buffer of a name, with at least `size` bytes. */
  of(name: string, size: number): GPUBuffer {
    const found = this.#buffers.get(name);
    if (found !== undefined && found.size >= size) return found;
    // Commands that were submitted with the old buffer still complete.
    found?.destroy();
    const buffer = this.#device.createBuffer({ label: `gs.generator.${name}`, size, usage: TENSOR_USAGE });
    this.#buffers.set(name, buffer);
    return buffer;
  }

  /** Copies the first `bytes` bytes of a buffer, rounded up to whole 32-bit words. */
  copy(from: GPUBuffer, to: GPUBuffer, bytes: number): void {
    const encoder = this.#device.createCommandEncoder({ label: 'gs.generator.copy' });
    encoder.copyBufferToBuffer(from, 0, to, 0, Math.ceil(bytes / 4) * 4);
    this.#device.queue.submit([encoder.finish()]);
  }

  /**
   * Writes numbers to a buffer. Fills the last 32-bit word, because GPU buffers are written in whole words and an odd
   * number of float16 ends within one.
   */
  write(buffer: GPUBuffer, { buffer: memory, byteOffset, byteLength }: ArrayBufferView<ArrayBuffer>): void {
    const whole = byteLength - (byteLength % 4);
    this.#device.queue.writeBuffer(buffer, 0, memory, byteOffset, whole);
    if (whole === byteLength) return;
    const word = new Uint8Array(4);
    word.set(new Uint8Array(memory, byteOffset + whole, byteLength - whole));
    this.#device.queue.writeBuffer(buffer, whole, word);
  }

  destroy(): void {
    for (const buffer of this.#buffers.values()) buffer.destroy();
    this.#buffers.clear();
  }
}
