import type { GaussianCloud } from './gaussian-cloud.js';
import type { Vector3 } from './vector.js';

/** Where the splats of a cloud are, in world units. */
export interface Bounds {
  /** Axis-aligned box of the centres. */
  readonly min: Vector3;
  readonly max: Vector3;
  /** Middle of the subject: per-axis median of the opaque centres, which far outliers do not move. */
  readonly center: Vector3;
  /** Distance from {@link center} within which 90 % of the opaque centres lie. */
  readonly radius: number;
}

/** Centres at most this many are sampled for medians: sorting millions would stall loading for no visible gain. */
const SAMPLE_LIMIT = 65_536;

/** Bounds of a cloud; of an empty one, a unit ball at its origin. */
export function boundsOf(cloud: Pick<GaussianCloud, 'count' | 'positions' | 'opacities' | 'origin'>): Bounds {
  const { count, positions, opacities, origin } = cloud;
  if (count === 0) return { min: origin, max: origin, center: origin, radius: 1 };
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (let axis = 0; axis < 3; axis++) {
    let least = Infinity;
    let most = -Infinity;
    for (let i = axis; i < 3 * count; i += 3) {
      const place = positions[i];
      if (place < least) least = place;
      if (place > most) most = place;
    }
    [min[axis], max[axis]] = [least, most];
  }
  const indices = sampleOpaque(opacities, count);
  const center = [0, 1, 2].map((axis) =>
    quantile(
      indices.map((i) => positions[3 * i + axis]),
      0.5,
    ),
  );
  const distances = indices.map((i) =>
    Math.hypot(positions[3 * i] - center[0], positions[3 * i + 1] - center[1], positions[3 * i + 2] - center[2]),
  );
  const toWorld = (p: number[]): Vector3 => [p[0] + origin[0], p[1] + origin[1], p[2] + origin[2]];
  return { min: toWorld(min), max: toWorld(max), center: toWorld(center), radius: quantile(distances, 0.9) || 1 };
}

/** Evenly spaced splats of opacity 0.1 or more; all splats if none is that opaque. */
function sampleOpaque(opacities: Float32Array, count: number): number[] {
  const step = Math.max(1, Math.floor(count / SAMPLE_LIMIT));
  const all = Array.from({ length: Math.ceil(count / step) }, (_, k) => k * step);
  const opaque = all.filter((i) => opacities[i] >= 0.1);
  return opaque.length > 0 ? opaque : all;
}

function quantile(values: number[], fraction: number): number {
  const sorted = Float64Array.from(values).sort();
  return sorted[Math.min(sorted.length - 1, Math.floor(fraction * sorted.length))];
}
