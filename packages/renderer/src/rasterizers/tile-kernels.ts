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

/** Kernels that list splats for bins. They are the same for all formats and variants. */
export interface ListingKernels {
  readonly count: ComputeKernel<typeof binCount>;
  readonly plan: ComputeKernel<typeof binPlan>;
  readonly emit: ComputeKernel<typeof binEmit>;
  readonly index: ComputeKernel<typeof binIndex>;
  readonly order: ComputeKernel<typeof binOrder>;
}

/** Returns the kernels that list splats for bins. */
export const listingKernels = (device: GPUDevice): ListingKernels => ({
  count: kernelOf(device, binCount),
  plan: kernelOf(device, binPlan),
  emit: kernelOf(device, binEmit),
  index: kernelOf(device, binIndex),
  order: kernelOf(device, binOrder),
});

/** Kernel that rasterizes tiles. Most variants have more bindings than `rasterize_tiles`. */
export type RasterizeKernel = ComputeKernel<typeof rasterizeTiles>;

/** Bindings that all kernels which rasterize tiles have. */
export type PaintedTiles = Parameters<RasterizeKernel['bind']>[0] & {
  readonly image: GPUTextureView;
  /** Results of segments of divided lists; undefined if no list is divided. */
  readonly segments?: GPUBuffer | undefined;
};

/**
 * Dispatches of an image of few tiles: shaders/shared/segments.wgsl. {@link WHOLE_LISTS} is the only one if no list is
 * divided.
 */
export type FewStage = 0 | 1 | 2 | typeof WHOLE_LISTS;
export const WHOLE_LISTS = 3;

/** Properties that select the pipeline of a kernel. */
export interface RasterizeVariant {
  readonly format: GPUTextureFormat;
  /** Whether the image is final: composed over the background. */
  readonly isFinal: boolean;
  /**
   * Whether pixels end before the splat that would reach the minimum transmittance: see
   * `RenderSettings.transmittanceMin`.
   */
  readonly refusesLast: boolean;
}

/** Returns the pipeline of a shader for a variant, which is created once for each device. */
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
