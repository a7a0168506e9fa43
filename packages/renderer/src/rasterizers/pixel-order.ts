/** Order of splats for each pixel, for the rasterizer `tiles`. Loaded with the first frame that requests it. */
import type { Camera } from '@gaussian-splat/core';
import type { FrameBindings } from '../bindings.js';
import { rasterizeTilesOrder } from '../generated/order-shaders.js';
import { constants, layouts } from '../generated/shaders.js';
import { BUFFER_USAGE, perDevice, TEXTURE_USAGE } from '../gpu/kernel.js';
import type { RenderSettings } from '../render-settings.js';
import type { Scratch } from '../scratch.js';
import { PixelDepths } from './pixel-depths.js';
import type { PaintingDepth } from './rasterizer.js';
import { rasterizeKernel, type RasterizeKernel, type RasterizeVariant } from './tile-kernels.js';
import { BoundImages, type TilePainter } from './tile-painter.js';

/**
 * Minimum number of pixels of an image whose windows of 16 splats have one word for each: see `has_keys` of
 * shaders/rasterize_tiles_order.wgsl. In smaller images more time is spent between batches.
 */
const KEYS_PIXELS = 1920 * 1080;

type DepthResources = PaintingDepth['resources'];

/** Device resources of `order: 'pixel'`: see shaders/pixel_depths.wgsl and shaders/rasterize_tiles_order.wgsl. */
export class PixelOrder {
  readonly #device: GPUDevice;
  readonly #depths: PixelDepths;
  readonly #bound = new BoundImages();
  readonly #keysPixels: number;

  /** @param keysPixels Minimum number of pixels of an image whose windows have one word a splat, for tests. */
  constructor(device: GPUDevice, keysPixels: number = KEYS_PIXELS) {
    this.#device = device;
    this.#keysPixels = keysPixels;
    this.#depths = new PixelDepths(device, true);
  }

  /**
   * Computes how the depth of each visible splat changes from pixel to pixel, and replaces the sort keys. Record this
   * after `project`.
   */
  recordDepths(pass: GPUComputePassEncoder, bindings: FrameBindings): void {
    this.#depths.record(pass, bindings);
  }

  /**
   * Returns the variant of tile rasterization that sorts splats for each pixel.
   * @param scratch Buffers of the frame; undefined if pipelines are only to be compiled.
   * @param depth Depth of the meshes in the frame; undefined for none.
   */
  painter(
    { orderWindow }: Pick<RenderSettings, 'orderWindow'>,
    camera?: Camera,
    scratch?: Scratch,
    depth?: PaintingDepth,
  ): TilePainter {
    const isWide = orderWindow === 32;
    const kernel = (variant: RasterizeVariant, hasKeys: boolean): RasterizeKernel =>
      rasterizeKernel(this.#device, rasterizeTilesOrder, variant, {
        ...{ is_wide: +isWide, has_keys: +hasKeys, is_parallel: +(camera?.orthographic === true) },
        ...depth?.overrides,
      });
    return {
      tile: constants.SMALL_TILE,
      kernel: (variant) => {
        if (!camera && !isWide) kernel(variant, true).prepare();
        return kernel(variant, !isWide && camera !== undefined && camera.width * camera.height >= this.#keysPixels);
      },
      bind: (kernel, painted) =>
        this.#bound.bind(kernel, painted, {
          ...{ pixel_depths: this.#depths.in(scratch!), cull_stats: scratch!.cullStats },
          ...(depth?.resources ?? noDepth(this.#device)),
        }),
    };
  }
}

/** Returns placeholders for the bindings of depth in frames without it. The shader does not read them. */
const noDepth = (device: GPUDevice): DepthResources =>
  perDevice(device, 'order without depth', () => {
    const texture = (usage: number): GPUTextureView =>
      device.createTexture({ label: 'gs.no_depth', size: [1, 1], format: 'r32float', usage }).createView();
    return {
      scene: device.createBuffer({ label: 'gs.no_depth', size: layouts.SceneDepth.size, usage: BUFFER_USAGE.uniform }),
      stored_depth: texture(TEXTURE_USAGE.textureBinding),
      median_depth: texture(TEXTURE_USAGE.storageBinding),
      layer_color: texture(TEXTURE_USAGE.textureBinding),
      second_depth: texture(TEXTURE_USAGE.textureBinding),
      second_color: texture(TEXTURE_USAGE.textureBinding),
    };
  });
