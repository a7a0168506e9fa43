/** Variants of tile rasterization. Each frame uses one of them. */
import { constants, rasterizeTiles } from '../generated/shaders.js';
import type { Resource } from '../gpu/kernel.js';
import { fewTilesOn } from './few-tiles-loader.js';
import {
  rasterizeKernel,
  type FewStage,
  type PaintedTiles,
  type RasterizeKernel,
  type RasterizeVariant,
} from './tile-kernels.js';

/** A variant of tile rasterization. */
export interface TilePainter {
  /** Side in pixels of what a workgroup rasterizes at most: `SIDE` of its shader. */
  readonly tile: number;
  /** Returns the kernel with the pipeline for a variant. */
  kernel(variant: RasterizeVariant): RasterizeKernel;
  /** Returns the kernel for a dispatch of an image of few tiles. Undefined if the variant does not draw such images. */
  few?(variant: RasterizeVariant, stage: FewStage): RasterizeKernel | undefined;
  /** Whether every list is rasterized as a whole. Default: false. */
  readonly hasWholeLists?: boolean;
  /** Returns the bind group for a frame's resources. */
  bind(kernel: RasterizeKernel, painted: PaintedTiles): GPUBindGroup;
}

/** Cache of bind groups by target image. A group is created again when other resources are bound. */
export class BoundImages {
  readonly #known = new WeakMap<GPUTextureView, { readonly key: readonly unknown[]; readonly group: GPUBindGroup }>();

  /** Returns the bind group of a kernel for an image. @param more Additional bindings of the kernel. */
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

/** Rasterizes splats without depth, auxiliary outputs or per-pixel order. */
export class PlainPainter extends BoundImages implements TilePainter {
  readonly tile = constants.TILE;
  readonly #device: GPUDevice;

  constructor(device: GPUDevice) {
    super();
    this.#device = device;
  }

  kernel(variant: RasterizeVariant): RasterizeKernel {
    return rasterizeKernel(this.#device, rasterizeTiles, variant);
  }

  few(variant: RasterizeVariant, stage: FewStage): RasterizeKernel | undefined {
    return fewTilesOn(this.#device).now?.kernel(variant, stage);
  }
}
