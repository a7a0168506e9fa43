import type { pixelDepths } from './generated/order-shaders.js';
import type { probeSurface } from './generated/probe-shaders.js';
import { cull, cullSerial, project, type cullChunks } from './generated/shaders.js';
import type { ShaderDescription } from './gpu/kernel.js';

/** A shader with the bindings of another. */
export type Like<S extends ShaderDescription> = ShaderDescription & Pick<S, 'bindings'>;

/**
 * The shaders that read the geometry of a block. Blocks in another layout than `PackedGaussian` provide their own, so
 * that these are loaded only with them.
 */
export interface GeometryReading {
  readonly cull: Like<typeof cull>;
  readonly cullSerial: Like<typeof cullSerial>;
  readonly project: Like<typeof project>;
  /** Replacements for shaders that are independent of the geometry. */
  readonly cullChunks?: Like<typeof cullChunks>;
  readonly pixelDepths?: Like<typeof pixelDepths>;
  readonly probeSurface?: Like<typeof probeSurface>;
}

/**
 * Modifies the splats of a placement during projection: a `SplatModifier`. Pages that use one provide it, so that it is
 * loaded only with them.
 */
export interface PlacementModifier {
  /** Holds the `Modifiers` of the placement. */
  readonly values: GPUBuffer;
  /** Changes with what it does. */
  readonly version: number;
  /** The shaders that read geometry of a kind and modify it. */
  reading(kind?: GeometryReading): GeometryReading;
}

/** Reads `PackedGaussian`. */
export const PACKED: GeometryReading = { cull, cullSerial, project };
