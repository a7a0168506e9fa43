/** What a renderer asks of its device and of those who call it, and the errors that say so. */
import { GaussianSplatError, type Camera } from '@gaussian-splat/core';
import type { FrameRequest } from './frame-request.js';
import type { AccumulationFormat, Rasterizer } from './rasterizers/rasterizer.js';

export function missingFormat(): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: 'FrameRequest.targetFormat',
    expected: 'the format of the target, which is a texture view',
    found: 'undefined',
    remedy: 'name the format, or give the texture itself',
  });
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

export function requireNotes({ name, takesNotes }: Rasterizer): void {
  if (takesNotes) return;
  throw new GaussianSplatError('unsupported/limits', {
    where: 'FrameRequest.notes',
    expected: 'a renderer with the rasterizer tiles',
    found: name,
    remedy: "make the renderer with { rasterizer: 'tiles' }",
  });
}

export function requireBlendable(device: GPUDevice, format: AccumulationFormat): void {
  if (format !== 'rgba32float' || device.features.has('float32-blendable')) return;
  throw new GaussianSplatError('unsupported/limits', {
    where: 'RendererOptions.accumulation',
    expected: 'a device with the feature float32-blendable',
    found: 'a device without it',
    remedy: 'ask for the feature with deviceDescriptor(adapter), or use rgba16float',
  });
}

/** Of a request what types alone would say. @throws GaussianSplatError `argument/value` */
export function requireRequest({ gaussians, levers, background }: Partial<FrameRequest>): void {
  const scenes = Array.isArray(gaussians) ? (gaussians as readonly unknown[]) : [gaussians];
  if (!scenes.every(isObject)) throw missing('gaussians', 'a scene, or a list of scenes', gaussians);
  if (levers !== undefined && !isObject(levers)) throw missing('levers', 'an object of levers, or undefined', levers);
  if (background === undefined) return;
  if (background?.length !== 4 || !Array.prototype.every.call(background, Number.isFinite))
    throw missing('background', 'four finite numbers: premultiplied red, green, blue and alpha', background);
}

const isObject = (value: unknown): boolean => typeof value === 'object' && value !== null;

function missing(name: keyof FrameRequest, expected: string, found: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: `FrameRequest.${name}`,
    expected,
    found: Array.isArray(found) ? `[${found.map(String).join(', ')}]` : String(found),
    remedy: `see FrameRequest.${name}`,
  });
}
