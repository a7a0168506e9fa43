/** The pipelines of the rasterizer `tiles`. */
import { binCount, binEmit, binIndex, binPlan, rasterizeTiles, rasterizeTilesNoting } from '../generated/shaders.js';
import {
  ComputeKernel,
  kernelOf,
  perDevice,
  storingInto,
  type Overrides,
  type ShaderDescription,
} from '../gpu/kernel.js';

/** Those that list splats for bins: the same whatever the image. */
export interface ListingKernels {
  readonly count: ComputeKernel<typeof binCount>;
  readonly plan: ComputeKernel<typeof binPlan>;
  readonly emit: ComputeKernel<typeof binEmit>;
  readonly index: ComputeKernel<typeof binIndex>;
}

export function listingKernels(device: GPUDevice): ListingKernels {
  return {
    count: kernelOf(device, binCount),
    plan: kernelOf(device, binPlan),
    emit: kernelOf(device, binEmit),
    index: kernelOf(device, binIndex),
  };
}

/** Paints tiles. The one that notes has more bindings: see `rasterize_tiles_noting`. */
export type RasterizeKernel = ComputeKernel<typeof rasterizeTiles>;

/** What one pipeline of `rasterize_tiles` is made for. */
export interface RasterizeVariant {
  readonly format: GPUTextureFormat;
  readonly isFinal: boolean;
  readonly isNoting: boolean;
  /** See `transmittanceMin` of the settings. */
  readonly refusesLast: boolean;
}

/** The pipeline for a variant; made once for each device. */
export function rasterizeKernel(
  device: GPUDevice,
  variant: RasterizeVariant,
  other?: ShaderDescription,
  overrides: Overrides = {},
): RasterizeKernel {
  const { format, isFinal, isNoting, refusesLast } = variant;
  const shader = (other ?? (isNoting ? rasterizeTilesNoting : rasterizeTiles)) as typeof rasterizeTiles;
  const [writesHalf, writesBytes] = [format === 'rgba16float', format.endsWith('8unorm')];
  const constants = {
    ...{ refuses_last: +refusesLast, is_final: +isFinal },
    ...{ writes_half: +writesHalf, writes_bytes: +writesBytes },
    ...overrides,
  };
  const key = `${shader.name} ${format} ${JSON.stringify(constants)}`;
  return perDevice(device, key, () => new ComputeKernel(device, storingInto(shader, format), constants));
}
