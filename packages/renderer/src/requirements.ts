/** What a renderer asks of its device and of those who call it, and the errors that say so. */
import { GaussianSplatError, type Camera } from '@gaussian-splat/core';
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
