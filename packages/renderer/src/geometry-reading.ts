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

/** Shaders that read `PackedGaussian`. */
export const PACKED: GeometryReading = { cull, cullSerial, project };
