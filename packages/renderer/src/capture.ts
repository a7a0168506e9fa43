import { validateCamera, type Camera } from '@gaussian-splat/core';
import { BUFFER_USAGE, TEXTURE_USAGE } from './gpu/kernel.js';
import type { FrameSettings, FrameTarget } from './frame-target.js';
import { requireTextureSize } from './texture-size.js';
import { untilItHasRoom } from './until-it-has-room.js';
import type { Viewpoint } from './viewpoint.js';

/** Alignment of the rows of a texture copy in bytes, as WebGPU requires. */
const ROW_ALIGNMENT = 256;
const BYTES_PER_PIXEL = 16;

/** A camera, the options of a frame without its texture, and settings; default: those of the viewpoint. */
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
  // An image may be larger than a buffer of the device.
  const rowsAtOnce = Math.min(height, Math.floor(device.limits.maxBufferSize / bytesPerRow));
  const texture = device.createTexture({
    label: 'gs.capture',
    size: [width, height],
    format: 'rgba32float',
    usage: TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.copySource,
  });
  const staging = device.createBuffer({
    label: 'gs.capture',
    size: bytesPerRow * rowsAtOnce,
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  try {
    await untilItHasRoom(() => {
      viewpoint.draw(request.camera, { ...request, target: texture }, request.settings);
      return viewpoint.isComplete();
    });
    const pixels = new Float32Array(4 * width * height);
    for (let first = 0; first < height; first += rowsAtOnce) {
      const rows = Math.min(rowsAtOnce, height - first);
      const encoder = device.createCommandEncoder({ label: 'gs.capture' });
      encoder.copyTextureToBuffer({ texture, origin: [0, first] }, { buffer: staging, bytesPerRow }, [width, rows]);
      device.queue.submit([encoder.finish()]);
      await staging.mapAsync(0x1);
      const padded = new Float32Array(staging.getMappedRange());
      for (let row = 0, at = 0; row < rows; row++, at += bytesPerRow / 4)
        pixels.set(padded.subarray(at, at + 4 * width), 4 * width * (first + row));
      staging.unmap();
    }
    return pixels;
  } finally {
    texture.destroy();
    staging.destroy();
  }
}
