/** Devices of Dawn other than the common one: with features and limits of choice, or with a compiler that errs. */
import { deviceDescriptor } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../../packages/cli/src/lib/node-gpu.mjs';
import { miscompile, type Miscompilation } from '../../support/miscompilation.js';

let full: Promise<GPUDevice> | undefined;

/** One device with all features of the renderer: blending in float32 if the adapter has it. */
export function fullDevice(): Promise<GPUDevice> {
  full ??= requestNodeAdapter().then((adapter) => adapter.requestDevice(deviceDescriptor(adapter)));
  return full;
}

/** A new device with exactly these optional features, as far as the adapter has them, and default limits. */
export async function deviceWith(features: readonly GPUFeatureName[]): Promise<GPUDevice> {
  const adapter = await requestNodeAdapter();
  return adapter.requestDevice({ requiredFeatures: features.filter((feature) => adapter.features.has(feature)) });
}

/** A new device whose compiler errs in the given ways. `befallen` lists the labels of the shaders that were changed. */
export async function faultyDevice(
  faults: readonly Miscompilation[],
): Promise<{ device: GPUDevice; befallen: string[] }> {
  const adapter = await requestNodeAdapter();
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  const befallen: string[] = [];
  const compile = device.createShaderModule.bind(device);
  device.createShaderModule = (descriptor) =>
    compile({ ...descriptor, code: miscompile(descriptor, faults, befallen) });
  return { device, befallen };
}
