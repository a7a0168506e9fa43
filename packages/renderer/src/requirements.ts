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

export function requireTextureSize(device: GPUDevice, { width, height }: Camera): void {
  const limit = device.limits.maxTextureDimension2D;
  if (Math.max(width, height) <= limit) return;
  throw new GaussianSplatError('argument/camera', {
    where: 'camera.width and camera.height',
    expected: `at most ${limit} pixels each (maxTextureDimension2D of the device)`,
    found: `${width}x${height}`,
    remedy: 'draw a smaller image, or several parts of it by moving cx and cy',
  });
}

/** Required properties of a target's texture. */
const TARGET: readonly (readonly [property: keyof GPUTexture, expected: unknown])[] = [
  ['sampleCount', 1],
  ['dimension', '2d'],
];

/**
 * @param target Texture to draw into; of a view only the format is known.
 * @throws GaussianSplatError `argument/value` for a texture that cannot be drawn into, or of another size than the
 * camera's image.
 */
export function requireTarget(target: GPUTexture | undefined, format: string, { width, height }: Camera): void {
  if (/depth|stencil|[us]int|snorm$|^(bc|etc|eac|astc)/.test(format))
    throw missing('target', 'a format that colours can be drawn into: rgba8unorm, bgra8unorm, rgba16float, …', format);
  if (target === undefined) return;
  const wrong = TARGET.find(([property, expected]) => target[property] !== expected);
  if (wrong) throw missing('target', `a texture of ${wrong[0]} ${String(wrong[1])}`, target[wrong[0]]);
  if ((target.usage & TEXTURE_USAGE.renderAttachment) === 0)
    throw missing('target', 'a texture with the usage RENDER_ATTACHMENT', `usage ${target.usage}`);
  if (target.width !== width || target.height !== height)
    throw missing(
      'target',
      `a texture of ${width} x ${height} pixels, as the camera says`,
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
    remedy: 'ask for the feature with deviceDescriptor(adapter), or use rgba16float',
  });
}

/** Checks the types of a frame target. @throws GaussianSplatError `argument/value` */
export function requireFrameTarget({ target, over, colors }: Partial<FrameTarget>, settings: FrameSettings): void {
  if (!isObject(target)) throw missing('target', 'a texture, or { view, format } of one', target);
  if (!('createView' in target) && (typeof target.format !== 'string' || !isObject(target.view)))
    throw missing('target', 'a texture, or a view of one with its format: { view, format }', JSON.stringify(target));
  if (!isObject(settings)) throw missing('settings', 'settings(…), or undefined', settings);
  if (over === 'target' && !colors && formatOf(target).endsWith('-srgb'))
    throw missing('colors', 'new LinearColors(device), to blend with what a target of linear light holds', colors);
  if (over === undefined || over === 'target') return;
  if (over?.length !== 4 || !Array.prototype.every.call(over, Number.isFinite))
    throw missing('over', "'target', or four finite numbers: premultiplied red, green, blue and alpha", over);
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
