/** Optional features that the renderer uses where they exist; it works without any. */
const USEFUL_FEATURES: readonly GPUFeatureName[] = [
  'float32-blendable',
  'bgra8unorm-storage',
  'subgroups',
  'timestamp-query',
];

/** Limits that decide how large a scene may be. */
const SIZE_LIMITS = ['maxBufferSize', 'maxStorageBufferBindingSize'] as const;

/** The device to ask an adapter for: its own size limits, and the optional features that the renderer can use. */
export function deviceDescriptor(adapter: GPUAdapter): GPUDeviceDescriptor {
  return {
    label: 'gaussian-splat',
    requiredFeatures: USEFUL_FEATURES.filter((feature) => adapter.features.has(feature)),
    requiredLimits: Object.fromEntries(SIZE_LIMITS.map((name) => [name, adapter.limits[name]])),
  };
}
