import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import { deviceDescriptor } from '@gaussian-splat/renderer';
import type * as reasons from './no-device.js';

/** Returns an error from the module no-device.ts, which is loaded on demand. */
export const why = async (reason: (of: typeof reasons) => GaussianSplatError): Promise<GaussianSplatError> =>
  reason(await loadModule('the text of an error', () => import('./no-device.js')));

/**
 * Rejects with GaussianSplatError `unsupported/no-webgpu` or `unsupported/insecure-context` if the page has no
 * `navigator.gpu`.
 */
export async function assertWebGpu(): Promise<void> {
  try {
    if (typeof navigator !== 'undefined' && navigator.gpu) return;
  } catch {
    // Privacy extensions may make `navigator.gpu` throw.
  }
  throw await why(({ noWebGpu }) => noWebGpu());
}

let wantsHeadset = false;

/** Makes later requests prefer adapters that are compatible with headsets. */
export function wantHeadset(): void {
  wantsHeadset = true;
}

/** Features that models use if they are available. Models with float16 need `shader-f16`. */
const GENERATOR_FEATURES: readonly GPUFeatureName[] = ['shader-f16', 'subgroups' as GPUFeatureName];
const GENERATOR_LIMITS = [
  'maxStorageBuffersPerShaderStage',
  'maxComputeWorkgroupStorageSize',
  'maxComputeInvocationsPerWorkgroup',
  'maxComputeWorkgroupSizeX',
  'maxComputeWorkgroupSizeY',
  'maxComputeWorkgroupSizeZ',
] as const;

/**
 * Adds the features and limits for generators to a descriptor. One device serves scenes and generators, because the
 * kind of later sources is unknown.
 */
function withGeneratorNeeds(adapter: GPUAdapter, descriptor: GPUDeviceDescriptor): GPUDeviceDescriptor {
  const features = GENERATOR_FEATURES.filter((feature) => adapter.features.has(feature));
  const limits = Object.fromEntries(GENERATOR_LIMITS.map((name) => [name, adapter.limits[name]]));
  return {
    ...descriptor,
    requiredFeatures: [...(descriptor.requiredFeatures ?? []), ...features],
    requiredLimits: { ...descriptor.requiredLimits, ...limits },
  };
}

/**
 * Requests a GPU device with the features and limits that the renderer and generators can use. Throws
 * GaussianSplatError `unsupported/*`.
 */
export async function requestGpuDevice(): Promise<GPUDevice> {
  await assertWebGpu();
  const request = (xrCompatible: boolean): Promise<GPUAdapter | null> =>
    navigator.gpu.requestAdapter({ powerPreference: 'high-performance', xrCompatible });
  // Pages with the attribute `vr` need an adapter that is compatible with headsets. If there is none, any adapter is
  // used.
  const adapter = (await request(wantsHeadset)) ?? (await request(false));
  if (adapter === null) throw await why(({ noAdapter }) => noAdapter());
  try {
    return await adapter.requestDevice(withGeneratorNeeds(adapter, deviceDescriptor(adapter)));
  } catch (error) {
    throw await why(({ noLimits }) => noLimits(error));
  }
}
