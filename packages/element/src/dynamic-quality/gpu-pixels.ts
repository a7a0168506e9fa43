/**
 * Reads the pixels of a WebGPU canvas without blocking the page. Reading them with a 2D canvas would block it until the
 * GPU has no other work.
 */

/** WebGPU requires that the bytes of a row of a copy are a multiple of this number. */
const ROW_ALIGNMENT = 256;

/** Pixels of a frame: [height, width, 4] premultiplied bytes, RGBA or BGRA, with padded rows. */
export interface FrameBytes {
  readonly bytes: Uint8Array;
  readonly width: number;
  readonly height: number;
  /** Number of bytes from one row to the next. */
  readonly rowBytes: number;
}

/**
 * Copies the frame that was drawn in the current task, and calls `use` with its bytes, which are valid during the call.
 * @returns The result of `use`; undefined if the canvas has no WebGPU context, cannot be copied, or does not have 8
 * bits per channel.
 */
export async function withGpuPixels<T>(
  canvas: HTMLCanvasElement,
  use: (frame: FrameBytes) => T,
): Promise<T | undefined> {
  const context = canvas.getContext('webgpu');
  const configuration = context?.getConfiguration?.();
  if (!context || !configuration) return undefined;
  const { device, format, usage } = configuration;
  if (!(usage & GPUTextureUsage.COPY_SRC) || !format.endsWith('a8unorm')) return undefined;
  const texture = context.getCurrentTexture();
  const { width, height } = texture;
  const rowBytes = ROW_ALIGNMENT * Math.ceil((4 * width) / ROW_ALIGNMENT);
  const { MAP_READ, COPY_DST } = GPUBufferUsage;
  const buffer = device.createBuffer({ label: 'gs.loss', size: rowBytes * height, usage: MAP_READ | COPY_DST });
  try {
    const encoder = device.createCommandEncoder();
    encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow: rowBytes }, [width, height]);
    device.queue.submit([encoder.finish()]);
    await buffer.mapAsync(GPUMapMode.READ);
    return use({ bytes: new Uint8Array(buffer.getMappedRange()), width, height, rowBytes });
  } finally {
    buffer.destroy();
  }
}
