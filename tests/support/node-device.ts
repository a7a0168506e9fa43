/** A device of Dawn in Node. Tests that use it run under `gpuEnvironment()` of scripts/lib. */
import { requestNodeAdapter } from '../../scripts/lib/node-gpu.mjs';

let device: Promise<GPUDevice> | undefined;

/** One device for all tests of a file, at WebGPU's default limits and without any optional feature. */
export function nodeDevice(): Promise<GPUDevice> {
  device ??= requestNodeAdapter().then((adapter) => adapter.requestDevice());
  return device;
}

/**
 * For `after` of every file that uses the device: Dawn keeps Node alive, and a process that ends while the GPU still works was seen to crash.
 */
export async function endNodeDevice(): Promise<void> {
  const used = await device;
  await used?.queue.onSubmittedWorkDone();
  used?.destroy();
  setImmediate(() => process.exit());
}
