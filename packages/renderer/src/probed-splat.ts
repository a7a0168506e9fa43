import type { Placement } from './world.js';

/** A splat of a scene. */
export interface ProbedSplat {
  /** Its placement in the world; undefined if a single scene is drawn with WebGL. */
  readonly placement: Placement | undefined;
  /**
   * Its index in its scene, in storage order: for a file, `packedOrder` maps it to a row. Null for a scene with levels
   * of detail, whose splats represent several.
   */
  readonly index: number | null;
}
