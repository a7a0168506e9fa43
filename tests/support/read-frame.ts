import type { FrameRequest, Renderer } from '@gaussian-splat/renderer';

/**
 * One frame as a renderer draws it at this moment, in float32: unlike `capture` it is never drawn again.
 * @param allowed how the target may be written; by default as the renderer likes
 */
export async function readFrame(
  device: GPUDevice,
  renderer: Renderer,
  request: Omit<FrameRequest, 'target' | 'targetFormat'>,
  allowed: GPUTextureUsageFlags = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.STORAGE_BINDING,
): Promise<Float32Array> {
  const { width, height } = request.camera;
  const usage = allowed | GPUTextureUsage.COPY_SRC;
  const texture = device.createTexture({ size: [width, height], format: 'rgba32float', usage });
  const bytesPerRow = Math.ceil((width * 16) / 256) * 256;
  const staging = device.createBuffer({
    size: bytesPerRow * height,
    usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ,
  });
  renderer.render({ ...request, target: texture });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture }, { buffer: staging, bytesPerRow }, [width, height]);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(GPUMapMode.READ);
  const rows = new Float32Array(staging.getMappedRange());
  const pixels = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) {
    const start = (y * bytesPerRow) / 4;
    pixels.set(rows.subarray(start, start + 4 * width), 4 * width * y);
  }
  staging.destroy();
  texture.destroy();
  return pixels;
}
