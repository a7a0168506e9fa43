/** Access to WebGPU in Node by Dawn. The process must have the environment of `gpuEnvironment()`. */
import { create, globals } from 'webgpu';
import { autotune, deviceDescriptor } from '@gaussian-splat/renderer';
import { calmPolling } from './calm-polling.mjs';
import { CommandError } from './command.mjs';

Object.assign(globalThis, globals);
calmPolling();

/** Instances of Dawn by their options. An instance must not be garbage-collected while one of its devices is used. */
const made = new Map();

/**
 * Returns an adapter. Throws an error that describes the remedy if there is none.
 * @param options.isTrusted Whether to disable Dawn's validation, for commands that are tested with validation. Validating
 * an indirect dispatch takes longer than most of these dispatches.
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
    throw new CommandError(
      'No WebGPU adapter in Node: expected a Vulkan driver, found none. ' +
        'Install one: Debian’s package mesa-vulkan-drivers also draws without a GPU.',
    );
  }
  return adapter;
}

/**
 * Returns an adapter of {@link requestNodeAdapter}, and its device for renderers. A software GPU gets the variants that it compiles in a fraction of the time, without a search. All
 * variants keep the same accuracy.
 */
export async function requestNodeDevice(options) {
  const adapter = await requestNodeAdapter(options);
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  const { architecture, description } = adapter.info;
  if (/swiftshader|llvmpipe/i.test(`${architecture} ${description}`)) {
    const accumulation = device.features.has('float32-blendable') ? 'rgba32float' : 'rgba16float';
    const choice = JSON.stringify({ rasterizer: 'quads', accumulation, threads: 'serial' });
    await autotune(device, { store: { getItem: () => choice, setItem: () => undefined } });
  }
  return { adapter, device };
}
