import { cull, cullSerial, project } from './generated/shaders.js';
import type { ShaderDescription } from './gpu/kernel.js';

/** A shader with the bindings of another. */
type Like<S extends ShaderDescription> = ShaderDescription & Pick<S, 'bindings'>;

/**
 * The shaders that read the geometry of a page. Pages that are stored in another way than `PackedGaussian` bring their own, so that no other page loads them.
 */
export interface GeometryReading {
  readonly cull: Like<typeof cull>;
  readonly cullSerial: Like<typeof cullSerial>;
  readonly project: Like<typeof project>;
}

/** Reads `PackedGaussian`. */
export const PACKED: GeometryReading = { cull, cullSerial, project };
