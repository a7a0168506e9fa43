import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import { deviceDescriptor } from '@gaussian-splat/renderer';
import type * as reasons from './no-device.js';

/** An error whose message is loaded on demand. */
export const why = async (reason: (of: typeof reasons) => GaussianSplatError): Promise<GaussianSplatError> =>
  reason(await loadModule('the text of an error', () => import('./no-device.js')));

/** Rejects with the reason if this page has no WebGPU at all. */
export async function assertWebGpu(): Promise<void> {
  try {
    if (typeof navigator !== 'undefined' && navigator.gpu) return;
  } catch {
    // Privacy extensions may make it throw.
  }
  throw await why(({ noWebGpu }) => noWebGpu());
}

/** Features for models on the same device, used if available; float16 models need the first. */
const GENERATOR_FEATURES: readonly GPUFeatureName[] = ['shader-f16', 'subgroups' as GPUFeatureName];
const GENERATOR_LIMITS = [
  'maxStorageBuffersPerShaderStage',
  'maxComputeWorkgroupStorageSize',
  'maxComputeInvocationsPerWorkgroup',
  'maxComputeWorkgroupSizeX',
  'maxComputeWorkgroupSizeY',
  'maxComputeWorkgroupSizeZ',
] as const;

/** One device serves scenes and generators, because the kind of later sources is unknown. */
function withGeneratorNeeds(adapter: GPUAdapter, descriptor: GPUDeviceDescriptor): GPUDeviceDescriptor {
  const features = GENERATOR_FEATURES.filter((feature) => adapter.features.has(feature));
  const limits = Object.fromEntries(GENERATOR_LIMITS.map((name) => [name, adapter.limits[name]]));
  return {
    ...descriptor,
    requiredFeatures: [...(descriptor.requiredFeatures ?? []), ...features],
    requiredLimits: { ...descriptor.requiredLimits, ...limits },
  };
}

/** Requests a GPU device with the limits that the renderer can use. Throws GaussianSplatError `unsupported/*`. */
export async function requestGpuDevice(): Promise<GPUDevice> {
  await assertWebGpu();
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: 'high-performance' });
  if (adapter === null) throw await why(({ noAdapter }) => noAdapter());
  try {
    return await adapter.requestDevice(withGeneratorNeeds(adapter, deviceDescriptor(adapter)));
  } catch (error) {
    throw await why(({ noLimits }) => noLimits(error));
  }
}
