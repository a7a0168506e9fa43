/** A device of Dawn in Node. Tests that use it run under `gpuEnvironment()` of scripts/lib. */
import { requestNodeAdapter } from '../../scripts/lib/node-gpu.mjs';

let device: Promise<GPUDevice> | undefined;

/** One device for all tests of a file, at WebGPU's default limits and without any optional feature. */
export function nodeDevice(): Promise<GPUDevice> {
  device ??= requestNodeAdapter().then((adapter) => adapter.requestDevice());
  return device;
}
