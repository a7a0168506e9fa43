import type { GaussianBlock, GaussianScene } from './gaussian-scene.js';
import type { GeometryReading } from './geometry-reading.js';
import type { Resource } from './gpu/kernel.js';

/**
 * Modifies the splats of a placement during projection: a `SplatModifier`. Pages with a modifier provide it, so that
 * other pages do not load its code.
 */
export interface PlacementModifier {
  /** Changes whenever the effect of the modifier changes. */
  readonly version: number;
  /** Returns the shaders that read a kind of geometry and modify it; default: `PackedGaussian`. */
  reading(kind?: GeometryReading): GeometryReading;
  /** Returns the resources that these shaders need in addition for a block of a scene. */
  resourcesOf(block: GaussianBlock, scene: GaussianScene): Readonly<Record<string, Resource>>;
}
