/** Variants of tile rasterization: one is selected for each frame. */
import { constants, rasterizeTiles } from '../generated/shaders.js';
import type { Resource } from '../gpu/kernel.js';
import { rasterizeKernel, type PaintedTiles, type RasterizeKernel, type RasterizeVariant } from './tile-kernels.js';

/** A variant of tile rasterization. */
export interface TilePainter {
  /** Side of its tiles, pixels. */
  readonly tile: number;
  kernel(variant: RasterizeVariant): RasterizeKernel;
  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup;
}

/** Bind groups by target image, created again when other resources are bound. */
export class BoundImages {
  readonly #known = new WeakMap<GPUTextureView, { readonly key: readonly unknown[]; readonly group: GPUBindGroup }>();

  /** @param more Additional bindings of the kernel. */
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

/** Rasterizes splats only. */
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
