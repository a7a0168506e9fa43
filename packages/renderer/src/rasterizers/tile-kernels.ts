/** The pipelines of the rasterizer `tiles`. */
import { binCount, binEmit, binIndex, binOrder, binPlan, type rasterizeTiles } from '../generated/shaders.js';
import {
  ComputeKernel,
  kernelOf,
  perDevice,
  storingInto,
  type Overrides,
  type ShaderDescription,
} from '../gpu/kernel.js';

/** Kernels that list splats for bins: the same for any image. */
export interface ListingKernels {
  readonly count: ComputeKernel<typeof binCount>;
  readonly plan: ComputeKernel<typeof binPlan>;
  readonly emit: ComputeKernel<typeof binEmit>;
  readonly index: ComputeKernel<typeof binIndex>;
  readonly order: ComputeKernel<typeof binOrder>;
}

/** @param tile Side of a tile in pixels. */
export function listingKernels(device: GPUDevice, tile: number): ListingKernels {
  const side = { tile_side: tile };
  return {
    count: kernelOf(device, binCount, side),
    plan: kernelOf(device, binPlan),
    emit: kernelOf(device, binEmit),
    index: kernelOf(device, binIndex, side),
    order: kernelOf(device, binOrder),
  };
}

/** Rasterizes tiles. Most variants have more bindings than `rasterize_tiles`. */
export type RasterizeKernel = ComputeKernel<typeof rasterizeTiles>;

/** Common bindings of every kernel that rasterizes tiles. */
export type PaintedTiles = Parameters<RasterizeKernel['bind']>[0] & { readonly image: GPUTextureView };

/** Key of one pipeline. */
export interface RasterizeVariant {
  readonly format: GPUTextureFormat;
  readonly isFinal: boolean;
  /** See `transmittanceMin` of the settings. */
  readonly refusesLast: boolean;
}

/** The pipeline of a shader for a variant, created once for each device. */
export function rasterizeKernel(
  device: GPUDevice,
  shader: ShaderDescription,
  { format, isFinal, refusesLast }: RasterizeVariant,
  overrides: Overrides = {},
): RasterizeKernel {
  const [writesHalf, writesBytes] = [format === 'rgba16float', format.endsWith('8unorm')];
  const constants = {
    ...{ refuses_last: +refusesLast, is_final: +isFinal },
    ...{ writes_half: +writesHalf, writes_bytes: +writesBytes },
    ...overrides,
  };
  const key = `${shader.name} ${format} ${JSON.stringify(constants)}`;
  const code = shader as typeof rasterizeTiles;
  return perDevice(device, key, () => new ComputeKernel(device, storingInto(code, format), constants));
}
