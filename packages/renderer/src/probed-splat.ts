import type { ProbeAnswer } from './depth-probe.js';
import { constants } from './generated/shaders.js';
import type { Placement } from './world.js';

const { PROBE_MIDDLE } = constants;

/** A splat that a probe found, and its scene. */
export interface ProbedSplat {
  /** Placement of the splat's scene in the world; undefined if a single scene is drawn with WebGL. */
  readonly placement: Placement | undefined;
  /**
   * Index of the splat in its scene, in storage order. For a file, `packedOrder` maps this index to a row. Null for a
   * scene with levels of detail, because its splats represent several.
   */
  readonly index: number | null;
}

/** Returns the depths of an answer that have names. */
export function depthsOf(layers: Float32Array): Pick<ProbeAnswer, 'near' | 'depth' | 'far'> {
  const [near, depth, far] = [0, PROBE_MIDDLE, 2 * PROBE_MIDDLE].map((level) => layers[level] || null);
  return { near, depth, far };
}
