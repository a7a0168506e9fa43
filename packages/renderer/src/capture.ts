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
 * viewpoint's buffers. {@link renderDepth} also returns the depth of each pixel.
 * @throws GaussianSplatError as {@link Viewpoint.draw} does, before anything is allocated.
 * @returns [height, width, 4] premultiplied red, green, blue and alpha, row by row from the top.
 */
export async function capture(device: GPUDevice, viewpoint: Viewpoint, request: CaptureRequest): Promise<Float32Array> {
  const [pixels] = await captureWith(device, viewpoint, request, []);
  return pixels;
}

/** Returns a texture for {@link captureWith}, of the size of a camera's image. */
export function imageFor(device: GPUDevice, camera: Camera, usage: number): GPUTexture {
  validateCamera(camera);
  requireTextureSize(device, camera);
  const size = [camera.width, camera.height];
  return device.createTexture({
    ...{ label: 'gs.capture', size, format: 'rgba32float' },
    usage: usage | TEXTURE_USAGE.copySource,
  });
}

/**
 * Draws one image: see {@link capture}.
 * @param more Textures that the frame writes in addition.
 * @returns Contents of the image, and of `more`: [height, width, 4] each.
 */
export async function captureWith(
  device: GPUDevice,
  viewpoint: Viewpoint,
  request: CaptureRequest,
  more: readonly GPUTexture[],
): Promise<Float32Array[]> {
  const texture = imageFor(device, request.camera, TEXTURE_USAGE.renderAttachment);
  try {
    await untilItHasRoom(() => {
      viewpoint.draw(request.camera, { ...request, target: texture }, request.settings);
      return viewpoint.isComplete();
    });
    const images: Float32Array[] = [];
    for (const image of [texture, ...more]) images.push(await readImage(device, image));
    return images;
  } finally {
    texture.destroy();
  }
}

async function readImage(device: GPUDevice, texture: GPUTexture): Promise<Float32Array> {
  const { width, height } = texture;
  const bytesPerRow = Math.ceil((width * BYTES_PER_PIXEL) / ROW_ALIGNMENT) * ROW_ALIGNMENT;
  // An image may be larger than a buffer of the device.
  const rowsAtOnce = Math.min(height, Math.floor(device.limits.maxBufferSize / bytesPerRow));
  const staging = device.createBuffer({
    label: 'gs.capture',
    size: bytesPerRow * rowsAtOnce,
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  try {
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
    staging.destroy();
  }
}
