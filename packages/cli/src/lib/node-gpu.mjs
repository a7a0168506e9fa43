/** A WebGPU adapter in Node, through Dawn. Run under `gpuEnvironment()`. */
import { create, globals } from 'webgpu';
import { calmPolling } from './calm-polling.mjs';

Object.assign(globalThis, globals);
calmPolling();

/** Dawn, by its options. It must not be collected while a device of it lives. */
const made = new Map();

/**
 * An adapter, or an error that says what is missing.
 * @param options.isTrusted leaves out Dawn's own checks, for commands that do what tests do with them. A check of an indirect dispatch takes longer than most of these dispatches do.
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
