import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import type { Image } from '@gaussian-splat/optimize';
import { GaussianBuffers, packGaussians, type Quality } from '@gaussian-splat/renderer';
import { capture, Renderer } from '../../support/renderer.js';

/** Draws clouds. */
export interface Painter {
  /** The images of a cloud in all views. */
  draw(cloud: GaussianCloud, views: readonly Camera[]): Promise<Image[]>;
}

/** Draws clouds with the project's renderer. */
export class Studio implements Painter {
  readonly #device: GPUDevice;
  readonly #renderer: Renderer;

  /** @param quality of the images that clouds are compared by. */
  constructor(device: GPUDevice, quality: Quality = 'reference') {
    this.#device = device;
    this.#renderer = new Renderer(device, { quality });
  }

  async draw(cloud: GaussianCloud, views: readonly Camera[]): Promise<Image[]> {
    const packed = packGaussians(cloud, { sh: 'float16' });
    const gaussians = await GaussianBuffers.upload(this.#device, packed);
    try {
      const images: Image[] = [];
      for (const camera of views) {
        images.push(await capture(this.#device, this.#renderer, { gaussians, camera }));
      }
      return images;
    } finally {
      gaussians.destroy();
    }
  }

  destroy(): void {
    this.#renderer.destroy();
  }
}

/** Whether any pixel of an image is covered. */
export const isCovered = (image: Image): boolean => image.some((value, k) => k % 4 === 3 && value !== 0);
