import { BUFFER_USAGE } from './kernel.js';

/** Maximum size of a buffer of the probe in bytes, which every device allows. */
const LARGEST = 1 << 27;

/**
 * Resolves to whether a device has this many bytes for buffers: allocates them, and frees them again. A device that is
 * lost meanwhile has not.
 */
export async function hasMemory(device: GPUDevice, bytes: number): Promise<boolean> {
  let isLost = false;
  void device.lost.then(() => (isLost = true));
  device.pushErrorScope('out-of-memory');
  const buffers: GPUBuffer[] = [];
  for (let left = bytes; left > 0; left -= LARGEST) {
    const size = 4 * Math.ceil(Math.min(LARGEST, left) / 4);
    buffers.push(device.createBuffer({ label: 'gs.memory-probe', size, usage: BUFFER_USAGE.storage }));
  }
  const refusal = await device.popErrorScope();
  for (const buffer of buffers) buffer.destroy();
  return refusal === null && !isLost;
}
