import type { pixelDepths } from './generated/order-shaders.js';
import type { probeSurface } from './generated/probe-shaders.js';
import { cull, cullSerial, project, type cullChunks } from './generated/shaders.js';
import type { ShaderDescription } from './gpu/kernel.js';

/** A shader with the bindings of another. */
export type Like<S extends ShaderDescription> = ShaderDescription & Pick<S, 'bindings'>;

/**
 * The shaders that read the geometry of a page. Pages that are stored in another way than `PackedGaussian` bring their own, so that no other page loads them.
 */
export interface GeometryReading {
  readonly cull: Like<typeof cull>;
  readonly cullSerial: Like<typeof cullSerial>;
  readonly project: Like<typeof project>;
  /** In place of those that all kinds share, or that go with the geometry. */
  readonly cullChunks?: Like<typeof cullChunks>;
  readonly pixelDepths?: Like<typeof pixelDepths>;
  readonly probeSurface?: Like<typeof probeSurface>;
}

/** What changes the splats of a placement while they are projected: a `SplatModifier`. Pages that use one bring it, so that no other page loads it. */
export interface PlacementModifier {
  /** Holds the `Modifiers` of the placement. */
  readonly values: GPUBuffer;
  /** The shaders that read geometry of a kind and modify it. */
  reading(kind?: GeometryReading): GeometryReading;
}

/** Reads `PackedGaussian`. */
export const PACKED: GeometryReading = { cull, cullSerial, project };
