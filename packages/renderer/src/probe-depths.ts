import { constants } from './generated/shaders.js';

const { PROBE_MIDDLE } = constants;

/** Returns those layers of a probe that have names: at 0.9, half, and 0.1 of the light; null if more is transmitted. */
export function depthsOf(layers: Float32Array): Record<'near' | 'depth' | 'far', number | null> {
  const [near, depth, far] = [0, PROBE_MIDDLE, 2 * PROBE_MIDDLE].map((level) => layers[level] || null);
  return { near, depth, far };
}
