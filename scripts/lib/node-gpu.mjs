/** A WebGPU adapter in Node, through Dawn. Run under `gpuEnvironment()`. */
import { create, globals } from 'webgpu';

Object.assign(globalThis, globals);

let gpu;

/** An adapter, or an error that says what is missing. */
export async function requestNodeAdapter() {
  gpu ??= create(process.platform === 'linux' ? ['backend=vulkan'] : []);
  const adapter = await gpu.requestAdapter();
  if (adapter === null) {
    throw new Error(
      'No WebGPU adapter in Node: expected a Vulkan driver or Chromium’s SwiftShader, found neither. ' +
        'Install Debian’s package chromium, or set GAUSSIAN_SPLAT_GPU=system on a machine with a Vulkan driver.',
    );
  }
  return adapter;
}
