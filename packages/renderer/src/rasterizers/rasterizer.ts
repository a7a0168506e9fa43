import type { FrameTimer } from '../gpu/pass-timer.js';
import type { Camera } from '@gaussian-splat/core';
import type { Overrides, ShaderDescription, ShaderProgram } from '../gpu/kernel.js';
import type { RenderSettings } from '../render-settings.js';
import type { CountPlace } from '../copy-counts.js';
import type { TilePainter } from './tile-painter.js';

/** Name of a rasterizer. `quads`: hardware rasterization and blending. `tiles`: compute shaders. */
export type RasterizerName = 'quads' | 'tiles';

/**
 * Format of the accumulation texture. Quads are blended into `rgba32float` only with the feature `float32-blendable`.
 */
export type AccumulationFormat = 'rgba16float' | 'rgba32float';

/** Inputs of every rasterizer. */
export interface RasterizerInputs {
  /** `Plan`, which contains the number of splats to draw */
  readonly plan: GPUBuffer;
  /** array<ProjectedSplat>, by slot */
  readonly splats: GPUBuffer;
  /** Slots of the visible splats, from near to far */
  readonly order: GPUBuffer;
  /**
   * Two buffers of at least {@link Rasterizer.pingPongBytes} each. They are reserved for the rasterizer from the end of
   * the sort until the next frame.
   */
  readonly pingPong: readonly [GPUBuffer, GPUBuffer];
  /** Maximum number of visible splats. */
  readonly capacity: number;
  /** Maximum number of pairs of splat and bin. */
  readonly pairCapacity: number;
}

/** Capacities that a rasterizer requires. */
export type Room = Pick<RasterizerInputs, 'capacity' | 'pairCapacity'>;

/** Texture view that a rasterizer draws to. Width and height are in pixels. */
export interface Surface {
  readonly view: GPUTextureView;
  readonly format: GPUTextureFormat;
  readonly width: number;
  readonly height: number;
}

/** Auxiliary outputs of a frame, besides its image. `renderDepth` writes depth and identity. */
export interface AuxiliaryTargets {
  /**
   * One u32 for each splat, in the order of `packedOrder`, with blocks padded to whole chunks of 256. It contains the
   * float32 bits of the largest weight (alpha times transmittance) of the splat in any pixel. Larger weights of earlier
   * frames are kept: clear the buffer for the weights of a single frame. Usage: STORAGE.
   */
  readonly contributions?: GPUBuffer;
}

/** Writes auxiliary outputs: `AuxiliaryOutputs` of `@gaussian-splat/renderer/tools`, or {@link DepthMaps}. */
export interface AuxiliaryOutputs {
  /** Returns the variant of tile rasterization for a frame. @param survivors Indices of the visible splats by slot. */
  painter(device: GPUDevice, survivors: GPUBuffer): AuxiliaryTilePainter;
}

export interface AuxiliaryTilePainter extends TilePainter {
  /** Inputs of the frame's rasterization; undefined before the frame is recorded. */
  readonly frame: AuxiliaryFrame | undefined;
}

/**
 * Rasterization inputs of a frame with auxiliary outputs, for passes that process the frame again. They belong to the
 * renderer: read them before the next frame.
 */
export interface AuxiliaryFrame {
  /** `BinView` of shaders/shared/bins.wgsl */
  readonly view: GPUBuffer;
  /** array<ProjectedSplat>, by slot */
  readonly splats: GPUBuffer;
  /** array<u32>: slots, bin by bin, in depth order within each bin */
  readonly pairs: GPUBuffer;
  /**
   * One bit for each tile of a bin and each pair, set if the splat touches the tile: `tile_word` of
   * shaders/shared/bins.wgsl
   */
  readonly tile_bits: GPUBuffer;
  /** array<vec2u>: for each bin the index of its first pair, and of the first pair after its last */
  readonly ranges: GPUBuffer;
  /** Indices of the splats by slot, in the order of {@link AuxiliaryTargets.contributions} */
  readonly survivors: GPUBuffer;
}

/** Textures of the meshes in a frame. */
export type DepthTexture = 'stored_depth' | 'median_depth' | 'layer_color' | 'second_depth' | 'second_color';

/**
 * Depth of meshes and depth output of a frame; `SceneDepth` implements it. Frames provide it, so that pages without
 * depth do not load its code.
 */
export interface PaintingDepth {
  /**
   * Prepares a frame before it is recorded. @param drawn Size of the rendered image in pixels. @throws
   * GaussianSplatError if the textures do not fit the frame.
   */
  prepare(
    camera: Camera,
    drawn: { readonly width: number; readonly height: number },
    rasterizer: RasterizerName,
    auxiliary: AuxiliaryOutputs | undefined,
  ): void;
  /** Returns the variant of tile rasterization with depth. @param depths Camera depths of the splats by slot. */
  painter(depths: GPUBuffer): TilePainter;
  readonly quadsProgram: QuadsWithDepth;
  /** Number of layers of color among the splats, 0 to 2. With 0, pixels end at the depth. */
  readonly layers: number;
  /** Program for `quads` that blends a layer over the splats behind it. */
  readonly layerProgram: Pick<ShaderProgram<ShaderDescription>, 'module' | 'pipelineLayout'>;
  readonly layerBindings: GPUBindGroup;
  /** Resources of a shader that reads depth. */
  readonly resources: Readonly<Record<'scene', GPUBuffer> & Record<DepthTexture, GPUTextureView>>;
  readonly overrides: Overrides;
}

/** Program and bindings of quads that read depths. */
export interface QuadsWithDepth extends Pick<ShaderProgram<ShaderDescription>, 'module' | 'pipelineLayout'> {
  readonly name: string;
  bind(
    resources: Readonly<Record<'raster' | 'plan' | 'splats' | 'order', GPUBuffer>>,
    depth: PaintingDepth,
    depths: GPUBuffer,
  ): GPUBindGroup;
}

/** Settings that rasterizers use. */
export type RasterSettings = Pick<RenderSettings, 'transmittanceMin'>;

/** One frame to draw. */
export interface Painting {
  readonly surface: Surface;
  readonly settings: RasterSettings;
  /**
   * Premultiplied background color, for which the surface receives the final image: only for surfaces that the
   * rasterizer `finishes`. Without it the surface receives color, with the transmittance in the alpha channel.
   */
  readonly background?: readonly [number, number, number, number];
  readonly timer?: FrameTimer | undefined;
  /** Depth of meshes, for `quads` only. */
  readonly depth?: PaintingDepth | undefined;
  /** Camera depths of the splats by slot; required with {@link depth}. */
  readonly depths?: GPUBuffer | undefined;
  /**
   * Variant of the tile rasterization, for `tiles` only. Default: without depth, auxiliary outputs and per-pixel order.
   */
  readonly painter?: TilePainter | undefined;
}

/**
 * A slice of a frame's rasterization; `index` is 0 to `count` - 1. All slices in order draw the image. Each rasterizer
 * divides a frame in its own way.
 */
export interface Slice {
  readonly index: number;
  readonly count: number;
}

/**
 * Rasterizes projected splats that are sorted by depth. Rasterizers are interchangeable: they have the same inputs, the
 * same falloff (shaders/shared/falloff.wgsl) and the same output.
 */
export interface Rasterizer {
  readonly name: RasterizerName;
  /** Bytes of allocated GPU memory. */
  readonly byteLength: number;
  /** `Plan` of the pairs of splat and bin; undefined for a rasterizer without pairs. */
  readonly pairPlan?: GPUBuffer;
  /** Place of the number of pairs of the longest list in the last frame; undefined for a rasterizer without lists. */
  readonly longest?: CountPlace | undefined;
  /** Takes this number of an earlier frame, to choose a kernel. */
  learn?(longest: number): void;
  /** Whether the rasterizer can write a final image of this format directly to the target. */
  finishes(format: GPUTextureFormat): boolean;
  /** Returns the required bytes of each buffer of {@link RasterizerInputs.pingPong}. */
  pingPongBytes(room: Room): number;
  /** Binds the buffers. Called again only when buffers are replaced. */
  bind(inputs: RasterizerInputs): void;
  /** Compiles the pipelines for other settings, so that no frame compiles them. @param format Format of the targets. */
  prepare(settings: RasterSettings, format: GPUTextureFormat, painter?: TilePainter): void;
  /** Records the work that all slices of a frame share, before the first slice. */
  prepareFrame(encoder: GPUCommandEncoder, painting: Painting): void;
  /** Records one slice of a frame. Each slice is submitted separately. */
  record(encoder: GPUCommandEncoder, painting: Painting, slice: Slice): void;
  destroy(): void;
}
