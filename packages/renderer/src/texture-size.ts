import { GaussianSplatError, type Camera } from '@gaussian-splat/core';

/** @throws GaussianSplatError `argument/camera` for an image that exceeds the textures of the device. */
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
