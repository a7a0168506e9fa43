/** A WebGPU adapter in Node, through Dawn. Run under `gpuEnvironment()`. */
import { create, globals } from 'webgpu';
import { calmPolling } from './calm-polling.mjs';

Object.assign(globalThis, globals);
calmPolling();

/** Dawn instances by options. They must not be garbage-collected while one of their devices lives. */
const made = new Map();

/**
 * Returns an adapter, or throws an error that describes the missing part.
 * @param options.isTrusted Disables Dawn's own validation, for commands whose work is tested with it. Validating an
 * indirect dispatch takes longer than most of these dispatches.
 */
export async function requestNodeAdapter({ isTrusted = false } = {}) {
  const options = [
    ...(process.platform === 'linux' ? ['backend=vulkan'] : []),
    ...(isTrusted ? ['enable-dawn-features=skip_validation'] : []),
  ];
  const key = options.join(' ');
  const gpu = made.get(key) ?? create(options);
  made.set(key, gpu);
  const adapter = await gpu.requestAdapter();
  if (adapter === null) {
    throw new Error(
      'No WebGPU adapter in Node: expected a Vulkan driver or Chromium’s SwiftShader, found neither. ' +
        'Install Debian’s package chromium, or set GAUSSIAN_SPLAT_GPU=system on a machine with a Vulkan driver.',
    );
  }
  return adapter;
}
