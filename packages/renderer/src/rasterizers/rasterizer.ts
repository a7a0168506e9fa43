import type { FrameTimer } from '../gpu/pass-timer.js';
import type { Camera } from '@gaussian-splat/core';
import type { Overrides, ShaderDescription, ShaderProgram } from '../gpu/kernel.js';
import type { RenderSettings } from '../render-settings.js';
import type { TilePainter } from './tile-painter.js';

/** `quads`: hardware rasterizer and blending. `tiles`: compute shaders. */
export type RasterizerName = 'quads' | 'tiles';

/** Formats of the accumulation texture. Quads blend into `rgba32float` only with the feature `float32-blendable`. */
export type AccumulationFormat = 'rgba16float' | 'rgba32float';

/** What every rasterizer reads. */
export interface RasterizerInputs {
  /** `Plan`: how many splats there are to draw. */
  readonly plan: GPUBuffer;
  /** array<ProjectedSplat> by slot. */
  readonly splats: GPUBuffer;
  /** Slots from near to far. */
  readonly order: GPUBuffer;
  /** Of at least {@link Rasterizer.spareBytes} each: nobody else's once splats are in order, until the next frame. */
  readonly spare: readonly [GPUBuffer, GPUBuffer];
  /** Most splats that can be visible. */
  readonly capacity: number;
  /** Pairs of splat and bin for which there shall be room. */
  readonly pairCapacity: number;
}

/** For how much there shall be room. */
export type Room = Pick<RasterizerInputs, 'capacity' | 'pairCapacity'>;

/** Where a rasterizer draws. */
export interface Surface {
  readonly view: GPUTextureView;
  readonly format: GPUTextureFormat;
  /** Pixels. */
  readonly width: number;
  readonly height: number;
}

/** What a frame tells about itself on the way, besides its image. */
export interface AuxiliaryTargets {
  /**
   * One word for each splat, in the order of `packedOrder`, pages filled up to whole chunks of 256: the bits of the largest weight, alpha times
   * transmittance, that the splat has had in any pixel. Weights of earlier frames stay where they are larger: clear the buffer for those
   * of one frame. Usage: storage.
   */
  readonly contributions?: GPUBuffer;
  /**
   * Receives the camera depth of each pixel, in world units to 11 bits: that of the splat that leaves it half transparent or less, 0 where none does.
   * A texture of the target's size, format `r32float`, usage STORAGE_BINDING.
   */
  readonly depth?: GPUTexture;
}

/** What writes auxiliary outputs: the class of this name in `@gaussian-splat/renderer/tools`. */
export interface AuxiliaryOutputs {
  /** @param survivors numbers of the visible splats by slot */
  painter(device: GPUDevice, survivors: GPUBuffer): AuxiliaryTilePainter;
}

export interface AuxiliaryTilePainter extends TilePainter {
  /** What the frame was painted from; undefined before it is recorded. */
  readonly frame: AuxiliaryFrame | undefined;
}

/** What a frame with auxiliary outputs was painted from, for passes that go over it again. All of it is the renderer's: to be read before the next frame. */
export interface AuxiliaryFrame {
  /** `BinView` of shaders/shared/bins.wgsl. */
  readonly view: GPUBuffer;
  /** array<ProjectedSplat> by slot. */
  readonly splats: GPUBuffer;
  /** array<u32>: slots, bin by bin and in depth order. */
  readonly pairs: GPUBuffer;
  /** Which pairs touch which tile: `tile_word` of shaders/shared/bins.wgsl. */
  readonly tile_bits: GPUBuffer;
  /** array<vec2u>: of each bin the first pair, and the one behind the last. */
  readonly ranges: GPUBuffer;
  /** Numbers of the splats by slot, as {@link AuxiliaryTargets.contributions} counts them. */
  readonly survivors: GPUBuffer;
}

/** Textures of what else is in a frame. */
export type DepthTexture = 'stored_depth' | 'median_depth' | 'layer_color' | 'second_depth' | 'second_color';

/** What a frame has to do with depth besides its own. `SceneDepth` is one; pictures bring it, so that pages without it load none of its code. */
export interface PaintingDepth {
  /** Called before a frame is recorded, with the pixels that are drawn. @throws GaussianSplatError for a frame that it does not fit */
  prepare(
    camera: Camera,
    drawn: { readonly width: number; readonly height: number },
    rasterizer: RasterizerName,
    auxiliary: AuxiliaryOutputs | undefined,
  ): void;
  /** @param depths camera depths of the splats by slot */
  painter(depths: GPUBuffer): TilePainter;
  readonly quadsProgram: QuadsWithDepth;
  /** Layers of color among the splats; 0 where the depth just ends pixels. */
  readonly layers: number;
  /** For quads: what blends a layer over the splats behind it. */
  readonly layerProgram: Pick<ShaderProgram<ShaderDescription>, 'module' | 'pipelineLayout'>;
  readonly layerBindings: GPUBindGroup;
  /** What a shader that has depth among other things binds, and its overrides. */
  readonly resources: Readonly<Record<'scene', GPUBuffer> & Record<DepthTexture, GPUTextureView>>;
  readonly overrides: Overrides;
}

/** Quads that read depths: what a pipeline is made of, and what is bound to it. */
export interface QuadsWithDepth extends Pick<ShaderProgram<ShaderDescription>, 'module' | 'pipelineLayout'> {
  readonly name: string;
  bind(
    resources: Readonly<Record<'raster' | 'plan' | 'splats' | 'order', GPUBuffer>>,
    depth: PaintingDepth,
    depths: GPUBuffer,
  ): GPUBindGroup;
}

/** Settings that rasterizers know. */
export type PaintingLevers = Pick<RenderSettings, 'transmittanceMin'>;

/** One frame to draw. */
export interface Painting {
  readonly surface: Surface;
  readonly levers: PaintingLevers;
  /**
   * Premultiplied colour to lay the splats over; the surface is then the final image. Without it the surface receives colour, and
   * transmittance in the alpha channel. Only for surfaces that the rasterizer `finishes`.
   */
  readonly background?: readonly [number, number, number, number];
  readonly timer?: FrameTimer | undefined;
  /** `quads` only: what the frame has to do with depth. */
  readonly depth?: PaintingDepth | undefined;
  /** Camera depths of the splats by slot; with {@link depth}. */
  readonly depths?: GPUBuffer | undefined;
  /** `tiles` only: how tiles are painted where not plainly. */
  readonly painter?: TilePainter | undefined;
}

/** A part of the painting of a frame: all `count` of them, in order, make the picture. What the parts are is the rasterizer's affair. */
export interface Slice {
  readonly index: number;
  readonly count: number;
}

/**
 * Paints projected, depth-ordered splats. Rasterizers are interchangeable: same inputs, same falloff
 * (shaders/shared/falloff.wgsl), same output.
 */
export interface Rasterizer {
  readonly name: RasterizerName;
  /** Bytes of GPU memory held. */
  readonly byteLength: number;
  /** `Plan` of the pairs of splat and bin, where there are pairs. */
  readonly pairPlan?: GPUBuffer;
  /** True if the rasterizer can write a final image of this format by itself. */
  finishes(format: GPUTextureFormat): boolean;
  /** Bytes of each buffer of {@link RasterizerInputs.spare} that it needs. */
  spareBytes(room: Room): number;
  /** Remembers the buffers; called again only when they are replaced. */
  bind(inputs: RasterizerInputs): void;
  /** Makes the pipelines for other settings, so that no frame has to. @param format of the targets */
  prepare(levers: PaintingLevers, format: GPUTextureFormat, painter?: TilePainter): void;
  /** Records what the parts of one frame have in common, before the first of them. */
  prepareFrame(encoder: GPUCommandEncoder, painting: Painting): void;
  /** Records the drawing of one part of one frame. Parts of a frame are submitted one by one. */
  record(encoder: GPUCommandEncoder, painting: Painting, slice: Slice): void;
  destroy(): void;
}
