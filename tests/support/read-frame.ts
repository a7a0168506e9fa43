import type { FrameRequest, Renderer } from './renderer.js';

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

/** Bytes of a pixel of each format that {@link readTexture} knows. */
const BYTES: Readonly<Partial<Record<GPUTextureFormat, number>>> = {
  rgba8unorm: 4,
  'rgba8unorm-srgb': 4,
  r32float: 4,
  rgba16float: 8,
  rgba32float: 16,
};

/** All numbers of a texture, row by row from the top; bytes as 0 to 1, as they are stored. */
export async function readTexture(device: GPUDevice, texture: GPUTexture): Promise<Float64Array> {
  const { width, height, format } = texture;
  const bytes = BYTES[format];
  if (bytes === undefined) throw new RangeError(`readTexture: ${format} is not known`);
  const bytesPerRow = Math.ceil((width * bytes) / 256) * 256;
  const staging = device.createBuffer({ size: bytesPerRow * height, usage: 0x9 });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture }, { buffer: staging, bytesPerRow }, [width, height]);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(1);
  const data = staging.getMappedRange();
  const numbers = numbersIn(data, format);
  const [stride, length] = [numbers.length / height, (width * numbers.length * bytes) / data.byteLength];
  const found = Float64Array.from(
    { length: length * height },
    (_, i) => numbers[Math.floor(i / length) * stride + (i % length)],
  );
  staging.destroy();
  return found;
}

function numbersIn(data: ArrayBuffer, format: GPUTextureFormat): ArrayLike<number> {
  if (format.startsWith('rgba8')) return Float64Array.from(new Uint8Array(data), (byte) => byte / 255);
  if (format === 'rgba16float') return Float64Array.from(new Uint16Array(data), halfValue);
  return new Float32Array(data);
}

function halfValue(bits: number): number {
  const [sign, exponent, digits] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return exponent === 0 ? sign * digits * 2 ** -24 : sign * 2 ** (exponent - 15) * (1 + digits / 1024);
}
