import type { pixelDepths } from './generated/order-shaders.js';
import type { probeSurface } from './generated/probe-shaders.js';
import { cull, cullSerial, project, type cullChunks } from './generated/shaders.js';
import type { ShaderDescription } from './gpu/kernel.js';

/** A shader with the bindings of shader `S`. */
export type Like<S extends ShaderDescription> = ShaderDescription & Pick<S, 'bindings'>;

/**
 * Shaders that read the geometry of a block. Blocks in another layout than `PackedGaussian` provide their own shaders,
 * so that other pages do not load them.
 */
export interface GeometryReading {
  readonly cull: Like<typeof cull>;
  readonly cullSerial: Like<typeof cullSerial>;
  readonly project: Like<typeof project>;
  /** Replacement of a shader that is otherwise independent of the geometry. */
  readonly cullChunks?: Like<typeof cullChunks>;
  readonly pixelDepths?: Like<typeof pixelDepths>;
  readonly probeSurface?: Like<typeof probeSurface>;
}

/**
 * Modifies the splats of a placement during projection: a `SplatModifier`. Pages with a modifier provide it, so that
 * other pages do not load its code.
 */
export interface PlacementModifier {
  /** Buffer with the `Modifiers` of the placement. */
  readonly values: GPUBuffer;
  /** Changes whenever the effect of the modifier changes. */
  readonly version: number;
  /** Returns the shaders that read a kind of geometry and modify it; default: `PackedGaussian`. */
  reading(kind?: GeometryReading): GeometryReading;
}

/** Shaders that read `PackedGaussian`. */
export const PACKED: GeometryReading = { cull, cullSerial, project };
