import { TEXTURE_USAGE } from './gpu/kernel.js';
import type { AccumulationFormat, Surface } from './rasterizers/rasterizer.js';

const BYTES_PER_PIXEL: Record<AccumulationFormat, number> = { rgba16float: 8, rgba32float: 16 };

/**
 * Float texture for the accumulation of splats: premultiplied color, and the transmittance in the alpha
 * channel.
 */
export class AccumulationTexture implements Surface {
  readonly width: number;
  readonly height: number;
  readonly format: AccumulationFormat;
  readonly view: GPUTextureView;
  readonly byteLength: number;
  readonly #texture: GPUTexture;

  constructor(device: GPUDevice, format: AccumulationFormat, width: number, height: number) {
    this.width = width;
    this.height = height;
    this.format = format;
    this.byteLength = width * height * BYTES_PER_PIXEL[format];
    this.#texture = device.createTexture({
      label: 'gs.rasterize.accumulation',
      size: [width, height],
      format,
      usage: TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.textureBinding | TEXTURE_USAGE.storageBinding,
    });
    this.view = this.#texture.createView();
  }

  destroy(): void {
    this.#texture.destroy();
  }
}
