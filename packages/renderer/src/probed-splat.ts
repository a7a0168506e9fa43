import type { Placement } from './world.js';

/** A splat of a scene. */
export interface ProbedSplat {
  /** Its place in the world; undefined where one scene is drawn alone: with WebGL. */
  readonly placement: Placement | undefined;
  /**
   * Its number among those of its scene, in the order in which they are stored: of a file, `packedOrder` has their rows. Null where a scene has levels of detail, whose
   * splats stand for several.
   */
  readonly index: number | null;
}
