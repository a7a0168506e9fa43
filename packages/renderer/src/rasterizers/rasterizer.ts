import type { PassTimer } from '../gpu/pass-timer.js';

/** Names of the rasterizers that a {@link Renderer} can be asked for. */
export type RasterizerName = 'quads' | 'tiles';

/** Formats of the accumulation texture. `rgba32float` needs the feature `float32-blendable`. */
export type AccumulationFormat = 'rgba16float' | 'rgba32float';

/** What every rasterizer reads. */
export interface RasterizerInputs {
  /** `Plan`: how many splats there are to draw, and indirect arguments. */
  readonly plan: GPUBuffer;
  /** array<ProjectedSplat> by slot. */
  readonly splats: GPUBuffer;
  /** Slots from near to far. */
  readonly order: GPUBuffer;
  /** Most splats that can be visible. */
  readonly capacity: number;
}

/** Where a rasterizer draws: colour, and transmittance in the alpha channel. */
export interface Accumulation {
  readonly view: GPUTextureView;
  /** Pixels. */
  readonly width: number;
  readonly height: number;
}

/**
 * Paints projected, depth-ordered splats. Rasterizers are interchangeable: same inputs, same falloff
 * (shaders/shared/falloff.wgsl), same output.
 */
export interface Rasterizer {
  readonly name: RasterizerName;
  /** Bytes of GPU memory held. */
  readonly byteLength: number;
  /** Remembers the buffers; called again only when they are replaced. */
  bind(inputs: RasterizerInputs): void;
  /** Records the drawing of one frame. */
  record(encoder: GPUCommandEncoder, accumulation: Accumulation, timer?: PassTimer): void;
  destroy(): void;
}
