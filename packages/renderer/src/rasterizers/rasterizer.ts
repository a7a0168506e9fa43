import type { FrameTimer } from '../gpu/pass-timer.js';
import type { Camera } from '@gaussian-splat/core';
import type { Overrides, ShaderDescription, ShaderProgram } from '../gpu/kernel.js';
import type { RenderSettings } from '../render-settings.js';
import type { TilePainter } from './tile-painter.js';

/** `quads`: hardware rasterization and blending. `tiles`: compute shaders. */
export type RasterizerName = 'quads' | 'tiles';

/** Formats of the accumulation texture. Quads blend into `rgba32float` only with the feature `float32-blendable`. */
export type AccumulationFormat = 'rgba16float' | 'rgba32float';

/** Inputs of every rasterizer. */
export interface RasterizerInputs {
  /** `Plan`: number of splats to draw. */
  readonly plan: GPUBuffer;
  /** array<ProjectedSplat> by slot. */
  readonly splats: GPUBuffer;
  /** Slots from near to far. */
  readonly order: GPUBuffer;
  /**
   * At least {@link Rasterizer.pingPongBytes} each: reserved for the rasterizer from the end of the sort until the next
   * frame.
   */
  readonly pingPong: readonly [GPUBuffer, GPUBuffer];
  /** Maximum number of visible splats. */
  readonly capacity: number;
  /** Required capacity in pairs of splat and bin. */
  readonly pairCapacity: number;
}

/** Required capacities. */
export type Room = Pick<RasterizerInputs, 'capacity' | 'pairCapacity'>;

/** Destination of a rasterizer. */
export interface Surface {
  readonly view: GPUTextureView;
  readonly format: GPUTextureFormat;
  /** Pixels. */
  readonly width: number;
  readonly height: number;
}

/** Auxiliary outputs of a frame, besides its image. */
export interface AuxiliaryTargets {
  /**
   * One word for each splat, in the order of `packedOrder`, with blocks padded to whole chunks of 256: the bits of the
   * largest weight, alpha times transmittance, of the splat in any pixel. Larger weights of earlier frames are kept:
   * clear the buffer for those of a single frame. Usage: storage.
   */
  readonly contributions?: GPUBuffer;
  /**
   * Receives the camera depth of each pixel, in world units to 11 bits: that of the splat that reduces its
   * transmittance to half or less, 0 if none does. A texture of the target's size, format `r32float`, usage
   * STORAGE_BINDING.
   */
  readonly depth?: GPUTexture;
}

/** Writes auxiliary outputs: implemented by the class of this name in `@gaussian-splat/renderer/tools`. */
export interface AuxiliaryOutputs {
  /** @param survivors Indices of the visible splats by slot. */
  painter(device: GPUDevice, survivors: GPUBuffer): AuxiliaryTilePainter;
}

export interface AuxiliaryTilePainter extends TilePainter {
  /** Inputs of the frame's rasterization; undefined before it is recorded. */
  readonly frame: AuxiliaryFrame | undefined;
}

/**
 * Rasterization inputs of a frame with auxiliary outputs, for passes that process it again. The renderer owns them:
 * read them before the next frame.
 */
export interface AuxiliaryFrame {
  /** `BinView` of shaders/shared/bins.wgsl. */
  readonly view: GPUBuffer;
  /** array<ProjectedSplat> by slot. */
  readonly splats: GPUBuffer;
  /** array<u32>: slots, bin by bin and in depth order. */
  readonly pairs: GPUBuffer;
  /** Bits of the pairs that touch each tile: `tile_word` of shaders/shared/bins.wgsl. */
  readonly tile_bits: GPUBuffer;
  /** array<vec2u>: for each bin the first pair, and the one after the last. */
  readonly ranges: GPUBuffer;
  /** Indices of the splats by slot, as in {@link AuxiliaryTargets.contributions}. */
  readonly survivors: GPUBuffer;
}

/** Textures of the meshes in a frame. */
export type DepthTexture = 'stored_depth' | 'median_depth' | 'layer_color' | 'second_depth' | 'second_color';

/**
 * Depth of a frame besides its own: `SceneDepth` implements it. Frames provide it, so that pages without it load none
 * of its code.
 */
export interface PaintingDepth {
  /** Called before a frame is recorded, with its resolution. @throws GaussianSplatError if it does not fit the frame. */
  prepare(
    camera: Camera,
    drawn: { readonly width: number; readonly height: number },
    rasterizer: RasterizerName,
    auxiliary: AuxiliaryOutputs | undefined,
  ): void;
  /** @param depths Camera depths of the splats by slot. */
  painter(depths: GPUBuffer): TilePainter;
  readonly quadsProgram: QuadsWithDepth;
  /** Layers of color among the splats; 0 if the depth only ends pixels. */
  readonly layers: number;
  /** For quads: blends a layer over the splats behind it. */
  readonly layerProgram: Pick<ShaderProgram<ShaderDescription>, 'module' | 'pipelineLayout'>;
  readonly layerBindings: GPUBindGroup;
  /** Resources and overrides of a shader that reads depth. */
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

/** Settings of rasterizers. */
export type RasterSettings = Pick<RenderSettings, 'transmittanceMin'>;

/** One frame to draw. */
export interface Painting {
  readonly surface: Surface;
  readonly settings: RasterSettings;
  /**
   * Premultiplied background color; the surface then receives the final image. Without it the surface receives color,
   * with the transmittance in the alpha channel. Only for surfaces that the rasterizer `finishes`.
   */
  readonly background?: readonly [number, number, number, number];
  readonly timer?: FrameTimer | undefined;
  /** `quads` only: depth of meshes. */
  readonly depth?: PaintingDepth | undefined;
  /** Camera depths of the splats by slot; with {@link depth}. */
  readonly depths?: GPUBuffer | undefined;
  /** `tiles` only: variant of the tile rasterization; default is the plain one. */
  readonly painter?: TilePainter | undefined;
}

/**
 * A slice of a frame's rasterization: all `count` of them, in order, give the image. Each rasterizer defines its
 * slices.
 */
export interface Slice {
  readonly index: number;
  readonly count: number;
}

/**
 * Rasterizes projected, depth-sorted splats. Rasterizers are interchangeable: same inputs, same falloff
 * (shaders/shared/falloff.wgsl), same output.
 */
export interface Rasterizer {
  readonly name: RasterizerName;
  /** Bytes of allocated GPU memory. */
  readonly byteLength: number;
  /** `Plan` of the pairs of splat and bin, if the rasterizer uses pairs. */
  readonly pairPlan?: GPUBuffer;
  /** Whether the rasterizer can write a final image of this format directly. */
  finishes(format: GPUTextureFormat): boolean;
  /** Required bytes of each buffer of {@link RasterizerInputs.spare}. */
  pingPongBytes(room: Room): number;
  /** Binds the buffers; called again only when they are replaced. */
  bind(inputs: RasterizerInputs): void;
  /** Compiles the pipelines for other settings, so that no frame has to. @param format Format of the targets. */
  prepare(settings: RasterSettings, format: GPUTextureFormat, painter?: TilePainter): void;
  /** Records the common work of all slices of a frame, before the first of them. */
  prepareFrame(encoder: GPUCommandEncoder, painting: Painting): void;
  /** Records one slice of a frame. Slices are submitted one by one. */
  record(encoder: GPUCommandEncoder, painting: Painting, slice: Slice): void;
  destroy(): void;
}
