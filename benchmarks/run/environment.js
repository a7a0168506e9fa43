/** The device to measure on, and everything about it that a reader of the figures needs. */
import { autotune, deviceDescriptor } from '@gaussian-splat/renderer';

/** Set by the build: the project's version and commit, and the versions of the peers. */
const VERSIONS = typeof BENCH_VERSIONS === 'undefined' ? {} : BENCH_VERSIONS;

/** A device with timestamps where there are any; `errors` collects what WebGPU complains about. */
export async function openDevice() {
  if (!navigator.gpu)
    throw new Error(
      'No WebGPU: expected navigator.gpu, found none. Use a browser with WebGPU, over https or on localhost.',
    );
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: 'high-performance' });
  if (adapter === null) throw new Error('No WebGPU adapter: the browser has WebGPU but found no GPU it may use.');
  const descriptor = deviceDescriptor(adapter);
  const canTime = adapter.features.has('timestamp-query');
  const features = new Set([...(descriptor.requiredFeatures ?? []), ...(canTime ? ['timestamp-query'] : [])]);
  const device = await adapter.requestDevice({ ...descriptor, requiredFeatures: [...features] });
  // Resolves `auto` as the element would, but never from an earlier visit.
  const variants = await autotune(device, { store: null });
  const errors = [];
  const note = (message) => errors.length < 20 && errors.push(message.slice(0, 300));
  device.addEventListener('uncapturederror', ({ error }) => note(error.message));
  device.lost.then(({ reason, message }) => reason !== 'destroyed' && note(`device lost: ${message}`));
  return { adapter, device, canTime, errors, variants };
}

/** Adapter, features, limits, browser and versions. */
export function describeEnvironment({ adapter, device, canTime, variants }) {
  const { vendor, architecture, device: model, description } = adapter.info;
  const limits = ['maxBufferSize', 'maxStorageBufferBindingSize', 'maxTextureDimension2D'];
  return {
    date: new Date().toISOString(),
    adapter: { vendor, architecture, device: model, description },
    features: [...device.features].sort(),
    limits: Object.fromEntries(limits.map((name) => [name, device.limits[name]])),
    timestamps: canTime,
    variants,
    userAgent: navigator.userAgent,
    processors: navigator.hardwareConcurrency,
    versions: VERSIONS,
  };
}

/** One line that names an adapter. */
export const adapterName = ({ vendor, architecture, device, description }) =>
  description || [vendor, architecture, device].filter(Boolean).join(' ') || 'unnamed adapter';
