/** Requirements of a renderer on its device and its callers, and the errors for them. */
import { GaussianSplatError, type Camera } from '@gaussian-splat/core';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import { TEXTURE_USAGE } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { AccumulationFormat } from './rasterizers/rasterizer.js';

/** Optional features that the renderer uses if available; it works without any. */
const USEFUL_FEATURES: readonly GPUFeatureName[] = [
  'float32-blendable',
  'bgra8unorm-storage',
  'subgroups',
  'timestamp-query',
];

/** Limits that determine the maximum size of a scene. */
const SIZE_LIMITS = ['maxBufferSize', 'maxStorageBufferBindingSize'] as const;

/**
 * Returns a descriptor for requesting a device: the adapter's own size limits, and the optional features that the
 * renderer can use.
 */
export function deviceDescriptor(adapter: GPUAdapter): GPUDeviceDescriptor {
  return {
    label: 'gaussian-splat',
    requiredFeatures: USEFUL_FEATURES.filter((feature) => adapter.features.has(feature)),
    requiredLimits: Object.fromEntries(SIZE_LIMITS.map((name) => [name, adapter.limits[name]])),
  };
}

/** Properties that the texture of a target must have. */
const TARGET: readonly (readonly [property: keyof GPUTexture, expected: unknown])[] = [
  ['sampleCount', 1],
  ['dimension', '2d'],
];

/**
 * Checks the texture of a target.
 * @param target Texture of the target; undefined for a view, whose only known property is its format.
 * @throws GaussianSplatError `argument/value` for a texture that cannot be drawn to, or of another size than the
 * camera's image.
 */
export function requireTarget(target: GPUTexture | undefined, format: string, { width, height }: Camera): void {
  if (/depth|stencil|[us]int|snorm$|^(bc|etc|eac|astc)/.test(format))
    throw missing('target', 'a format that colors can be drawn into: rgba8unorm, bgra8unorm, rgba16float, …', format);
  if (target === undefined) return;
  const wrong = TARGET.find(([property, expected]) => target[property] !== expected);
  if (wrong) throw missing('target', `a texture of ${wrong[0]} ${String(wrong[1])}`, target[wrong[0]]);
  if ((target.usage & TEXTURE_USAGE.renderAttachment) === 0)
    throw missing('target', 'a texture with the usage RENDER_ATTACHMENT', `usage ${target.usage}`);
  if (target.width !== width || target.height !== height)
    throw missing(
      'target',
      `a texture of ${width} x ${height} pixels, the size of the camera`,
      `${target.width} x ${target.height}`,
    );
}

export function requireAuxiliary({ rasterizer, order }: Pick<RenderSettings, 'rasterizer' | 'order'>): void {
  if (order === 'pixel')
    throw missing('auxiliary', "settings with order: 'center', or no auxiliary outputs", "order: 'pixel'");
  if (rasterizer === 'tiles') return;
  throw new GaussianSplatError('unsupported/limits', {
    where: 'FrameTarget.auxiliary',
    expected: 'settings with the rasterizer tiles',
    found: rasterizer,
    remedy: "draw with settings('default', { rasterizer: 'tiles' })",
  });
}

export function requireBlendable(device: GPUDevice, format: AccumulationFormat): void {
  if (format !== 'rgba32float' || device.features.has('float32-blendable')) return;
  throw new GaussianSplatError('unsupported/limits', {
    where: 'FrameSettings.accumulation',
    expected: 'a device with the feature float32-blendable',
    found: 'a device without it',
    remedy: 'request the feature with deviceDescriptor(adapter), or use rgba16float',
  });
}

/**
 * Checks the types of a frame target and its settings.
 * @throws GaussianSplatError `argument/value` for a value of another type, or for a background that requires `colors`.
 */
export function requireFrameTarget(
  { target, background, colors }: Partial<FrameTarget>,
  settings: FrameSettings,
): void {
  if (!isObject(target)) throw missing('target', 'a texture, or { view, format } of one', target);
  if (!('createView' in target) && (typeof target.format !== 'string' || !isObject(target.view)))
    throw missing('target', 'a texture, or a view of one with its format: { view, format }', JSON.stringify(target));
  if (!isObject(settings)) throw missing('settings', 'settings(…), or undefined', settings);
  if (background === 'load' && !colors && formatOf(target).endsWith('-srgb'))
    throw missing('colors', 'new LinearColors(device), to blend with the content of a target in linear light', colors);
  if (background === undefined || background === 'load') return;
  if (background?.length !== 4 || !Array.prototype.every.call(background, Number.isFinite))
    throw missing('background', "'load', or four finite numbers: premultiplied red, green, blue and alpha", background);
}

const formatOf = (target: GPUTexture | { readonly format: GPUTextureFormat }): string => target.format;

const isObject = (value: unknown): value is object => typeof value === 'object' && value !== null;

function missing(name: keyof FrameTarget | 'settings', expected: string, found: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: name === 'settings' ? 'FrameSettings' : `FrameTarget.${name}`,
    expected,
    found: Array.isArray(found) ? `[${found.map(String).join(', ')}]` : String(found),
    remedy: `see ${name === 'settings' ? 'FrameSettings' : `FrameTarget.${name}`}`,
  });
}
