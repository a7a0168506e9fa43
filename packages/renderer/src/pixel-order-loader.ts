import { loadModule } from '@gaussian-splat/core';
import { perDevice } from './gpu/kernel.js';
import type { PixelOrder } from './rasterizers/pixel-order.js';

/** Device resources of `order: 'pixel'`, loaded when a frame first requests it. */
export interface PixelOrderLoader {
  /** The loaded resources; undefined before. */
  now?: PixelOrder;
  /** Loads the resources. @throws GaussianSplatError `network/unreachable` if their code cannot be loaded. */
  load(): Promise<unknown>;
}

export const orderOn = (device: GPUDevice): PixelOrderLoader =>
  perDevice(device, 'order', () => {
    const lazy: PixelOrderLoader = {
      load: () =>
        loadModule('the code that orders splats pixel by pixel', async () => {
          const { PixelOrder } = await import('./rasterizers/pixel-order.js');
          lazy.now ??= new PixelOrder(device);
        }),
    };
    return lazy;
  });
