import { validateCamera, type Camera } from '@gaussian-splat/core';
import { BUFFER_USAGE, TEXTURE_USAGE } from './gpu/kernel.js';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import { requireTextureSize } from './requirements.js';
import { untilItHasRoom } from './until-it-has-room.js';
import type { Viewpoint } from './viewpoint.js';

/** Rows of a texture copy start at multiples of this many bytes. */
const ROW_ALIGNMENT = 256;
const BYTES_PER_PIXEL = 16;

/** A camera, a target without texture, and the settings. */
export interface CaptureRequest extends Omit<FrameTarget, 'target'> {
  readonly camera: Camera;
  readonly settings?: FrameSettings;
}

/**
 * Draws one image and reads it back in float32, before any rounding to 8 bits. Draws again if the image did not fit the
 * viewpoint's buffers.
 * @throws GaussianSplatError as {@link Viewpoint.draw} does, before anything is allocated.
 * @returns [height, width, 4] premultiplied red, green, blue and alpha, row by row from the top.
 */
export async function capture(device: GPUDevice, viewpoint: Viewpoint, request: CaptureRequest): Promise<Float32Array> {
  validateCamera(request.camera);
  requireTextureSize(device, request.camera);
  const { width, height } = request.camera;
  const bytesPerRow = Math.ceil((width * BYTES_PER_PIXEL) / ROW_ALIGNMENT) * ROW_ALIGNMENT;
  const texture = device.createTexture({
    label: 'gs.capture',
    size: [width, height],
    format: 'rgba32float',
    usage: TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.copySource,
  });
  const staging = device.createBuffer({
    label: 'gs.capture',
    size: bytesPerRow * height,
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  try {
    await untilItHasRoom(() => {
      viewpoint.draw(request.camera, { ...request, target: texture }, request.settings);
      return viewpoint.isComplete();
    });
    const encoder = device.createCommandEncoder({ label: 'gs.capture' });
    encoder.copyTextureToBuffer({ texture }, { buffer: staging, bytesPerRow }, [width, height]);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(0x1);
    return withoutPadding(new Float32Array(staging.getMappedRange()), bytesPerRow / 4, 4 * width, height);
  } finally {
    texture.destroy();
    staging.destroy();
  }
}

function withoutPadding(rows: Float32Array, stride: number, length: number, count: number): Float32Array {
  const pixels = new Float32Array(length * count);
  for (let row = 0; row < count; row++) pixels.set(rows.subarray(row * stride, row * stride + length), row * length);
  return pixels;
}
