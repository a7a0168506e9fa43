import type { Placement } from './world.js';

/** A splat that a probe found, and its scene. */
export interface ProbedSplat {
  /** Placement of the splat's scene in the world; undefined if a single scene is drawn with WebGL. */
  readonly placement: Placement | undefined;
  /** Number of the scene among those that are drawn with WebGL in one order; undefined with WebGPU. */
  readonly scene?: number;
  /**
   * Index of the splat in its scene, in storage order. For a file, `packedOrder` maps this index to a row. Null for a
   * scene with levels of detail, because its splats represent several.
   */
  readonly index: number | null;
}
