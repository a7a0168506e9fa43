/** Textures back from the GPU. */

const ROW_ALIGNMENT = 256;
const BYTES_PER_PIXEL = { rgba8unorm: 4, bgra8unorm: 4, rgba16float: 8, rgba32float: 16 };

/** [height, width, 4] red, green, blue, alpha in 0..1 as float32, row by row from the top. */
export async function readPixels(device, texture) {
  const { width, height, format } = texture;
  const bytesPerPixel = BYTES_PER_PIXEL[format];
  if (bytesPerPixel === undefined) throw new RangeError(`readPixels: no way to read ${format}`);
  const bytesPerRow = Math.ceil((width * bytesPerPixel) / ROW_ALIGNMENT) * ROW_ALIGNMENT;
  const staging = device.createBuffer({
    size: bytesPerRow * height,
    usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ,
  });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture }, { buffer: staging, bytesPerRow }, [width, height]);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(GPUMapMode.READ);
  const rows = toNumbers(staging.getMappedRange(), format);
  const stride = (bytesPerRow / bytesPerPixel) * 4;
  const pixels = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) pixels.set(rows.subarray(y * stride, y * stride + 4 * width), 4 * width * y);
  staging.destroy();
  return pixels;
}

function toNumbers(bytes, format) {
  if (format === 'rgba32float') return new Float32Array(bytes);
  if (format === 'rgba16float') return Float32Array.from(new Uint16Array(bytes), fromHalf);
  const numbers = Float32Array.from(new Uint8Array(bytes), (byte) => byte / 255);
  if (format === 'bgra8unorm') {
    for (let i = 0; i < numbers.length; i += 4) [numbers[i], numbers[i + 2]] = [numbers[i + 2], numbers[i]];
  }
  return numbers;
}

/** The number that the bits of a float16 stand for. */
function fromHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return exponent === 0 ? sign * fraction * 2 ** -24 : sign * 2 ** (exponent - 15) * (1 + fraction / 1024);
}
