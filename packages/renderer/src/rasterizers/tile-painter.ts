/** The ways to paint tiles: one is chosen for each frame. */
import { constants, rasterizeTiles } from '../generated/shaders.js';
import type { Resource } from '../gpu/kernel.js';
import { rasterizeKernel, type PaintedTiles, type RasterizeKernel, type RasterizeVariant } from './tile-kernels.js';

/** A way to paint tiles. */
export interface TilePainter {
  /** Side of its tiles, pixels. */
  readonly tile: number;
  kernel(variant: RasterizeVariant): RasterizeKernel;
  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup;
}

/** Bind groups by the image that is painted into, made anew when something else is bound. */
export class BoundImages {
  readonly #known = new WeakMap<GPUTextureView, { readonly key: readonly unknown[]; readonly group: GPUBindGroup }>();

  /** @param more what the kernel binds besides */
  bind(kernel: RasterizeKernel, painted: PaintedTiles, more: Readonly<Record<string, Resource>> = {}): GPUBindGroup {
    const resources = { ...painted, ...more };
    const key = [kernel, ...Object.values(resources)];
    const known = this.#known.get(painted.image);
    if (known?.key.length === key.length && known.key.every((value, k) => value === key[k])) return known.group;
    const group = kernel.bind(resources);
    this.#known.set(painted.image, { key, group });
    return group;
  }
}

/** Paints splats and nothing else. */
export class PlainPainter implements TilePainter {
  readonly tile = constants.TILE;
  readonly #device: GPUDevice;
  readonly #bound = new BoundImages();

  constructor(device: GPUDevice) {
    this.#device = device;
  }

  kernel(variant: RasterizeVariant): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTiles, variant);
  }

  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup {
    return this.#bound.bind(kernel, painted);
  }
}
