import { GaussianSplatError } from '@gaussian-splat/core';
import { deviceDescriptor } from '@gaussian-splat/renderer';

/** Throws the reason, if there is one, why this page has no WebGPU at all. */
export function assertWebGpu(): void {
  if (typeof navigator !== 'undefined' && 'gpu' in navigator && navigator.gpu) return;
  if (globalThis.isSecureContext === false) {
    throw new GaussianSplatError('unsupported/insecure-context', {
      where: 'this page',
      expected: 'a secure context, since browsers offer WebGPU in no other',
      found: `the insecure address ${globalThis.location?.origin ?? '(none)'}`,
      remedy: 'serve the page over https, or from localhost',
    });
  }
  throw new GaussianSplatError('unsupported/no-webgpu', {
    where: 'this browser',
    expected: 'WebGPU (navigator.gpu)',
    found: 'none',
    remedy: 'use a current Chrome, Edge, Safari or Firefox with WebGPU switched on',
  });
}

/** What models on the same device can use where it is there; float16 models need the first. */
const GENERATOR_FEATURES: readonly GPUFeatureName[] = ['shader-f16', 'subgroups' as GPUFeatureName];
const GENERATOR_LIMITS = [
  'maxStorageBuffersPerShaderStage',
  'maxComputeWorkgroupStorageSize',
  'maxComputeInvocationsPerWorkgroup',
  'maxComputeWorkgroupSizeX',
  'maxComputeWorkgroupSizeY',
  'maxComputeWorkgroupSizeZ',
] as const;

/** One device serves scenes and generators: nobody knows beforehand which a page will show. */
function withGeneratorNeeds(adapter: GPUAdapter, descriptor: GPUDeviceDescriptor): GPUDeviceDescriptor {
  const features = GENERATOR_FEATURES.filter((feature) => adapter.features.has(feature));
  const limits = Object.fromEntries(GENERATOR_LIMITS.map((name) => [name, adapter.limits[name]]));
  return {
    ...descriptor,
    requiredFeatures: [...(descriptor.requiredFeatures ?? []), ...features],
    requiredLimits: { ...descriptor.requiredLimits, ...limits },
  };
}

/** A GPU device with the limits that the renderer can use. Throws GaussianSplatError `unsupported/*`. */
export async function requestGpuDevice(): Promise<GPUDevice> {
  assertWebGpu();
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: 'high-performance' });
  if (adapter === null) {
    throw new GaussianSplatError('unsupported/no-adapter', {
      where: 'this browser',
      expected: 'a graphics adapter for WebGPU',
      found: 'none',
      remedy: 'switch on hardware acceleration in the browser settings, or update the graphics driver',
    });
  }
  try {
    return await adapter.requestDevice(withGeneratorNeeds(adapter, deviceDescriptor(adapter)));
  } catch (error) {
    throw new GaussianSplatError('unsupported/limits', {
      where: 'the graphics adapter',
      expected: 'a device within the limits that the adapter itself reports',
      found: error instanceof Error ? error.message : String(error),
      remedy: 'update the graphics driver or the browser',
      cause: error,
    });
  }
}
