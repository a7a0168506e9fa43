import { loadModule } from '@gaussian-splat/core';
import { perDevice } from './gpu/kernel.js';
import type { PixelOrder } from './rasterizers/pixel-order.js';

/** Fetches what `order: 'pixel'` needs when a frame first asks for it. */
export class LazyOrder {
  readonly #device: GPUDevice;
  #loaded: PixelOrder | undefined;
  #loading: Promise<void> | undefined;

  static of(device: GPUDevice): LazyOrder {
    return perDevice(device, 'pixel order', () => new LazyOrder(device));
  }

  private constructor(device: GPUDevice) {
    this.#device = device;
  }

  /** Undefined until it is there. */
  get now(): PixelOrder | undefined {
    return this.#loaded;
  }

  /** @throws GaussianSplatError `network/unreachable`; the next call tries again. */
  load(): Promise<void> {
    return (this.#loading ??= loadModule('the code that orders splats pixel by pixel', async () => {
      const { PixelOrder } = await import('./rasterizers/pixel-order.js');
      this.#loaded = new PixelOrder(this.#device);
    }).catch((error) => {
      this.#loading = undefined;
      throw error;
    }));
  }
}
