import type { GaussianCloud } from './gaussian-cloud.js';
import type { InnerView } from './views/inner-view.js';
import type { Vector3 } from './vector.js';

/** A sphere, in world units. */
export interface Ball {
  readonly center: Vector3;
  readonly radius: number;
}

/** Bounds of the splats of a cloud, in world units. */
export interface Bounds {
  /** Lower corner of the axis-aligned box of the centers. */
  readonly min: Vector3;
  /** Upper corner of the axis-aligned box of the centers. */
  readonly max: Vector3;
  /** Center of the subject: the median of the opaque centers on each axis, which is robust to outliers. */
  readonly center: Vector3;
  /** Radius of the sphere around {@link center} that contains 90 % of the opaque centers. */
  readonly radius: number;
  /**
   * Sphere around an isolated subject, such as an avatar, which contains 99.9 % of the opaque centers. Undefined if the
   * density of the surroundings decreases gradually.
   */
  readonly subject?: Ball;
  /** First view of a scene that hides itself from outside, such as a captured room; undefined for other scenes. */
  readonly inside?: InnerView | undefined;
}

/** Maximum number of centers that are sampled for medians. Sorting millions of centers would delay loading. */
const SAMPLE_LIMIT = 65_536;
/** Fraction of the opaque centers that belong to a subject. The rest are specks after the removal of a background. */
const OF_SUBJECT = 0.999;
/** Maximum ratio of two radii of an isolated subject, of all its centers and of 99 % of them: 1 to 1.3 in captures. */
const ENDS_WITHIN = 1.5;

/** Returns the bounds of a cloud; for an empty cloud, a unit sphere at its origin. */
export function boundsOf(cloud: Pick<GaussianCloud, 'count' | 'positions' | 'opacities' | 'origin'>): Bounds {
  const { count, positions, opacities, origin } = cloud;
  if (count === 0) return { min: origin, max: origin, center: origin, radius: 1 };
  const toWorld = (p: readonly number[]): Vector3 => [p[0] + origin[0], p[1] + origin[1], p[2] + origin[2]];
  const [min, max] = boxOf(positions.subarray(0, 3 * count));
  const places = placesOf(positions, sampleOpaque(opacities, count));
  const center = [0, 1, 2].map((axis) => quantile(axisOf(places, axis).sort(), 0.5));
  const distances = distancesTo(places, center);
  const sorted = distances.slice().sort();
  const end = quantile(sorted, OF_SUBJECT);
  const bounds = {
    ...{ min: toWorld(min), max: toWorld(max), center: toWorld(center) },
    radius: quantile(sorted, 0.9) || 1,
  };
  if (!(end > 0 && end <= ENDS_WITHIN * quantile(sorted, 0.99))) return bounds;
  const subject = ballAround(within(places, distances, end));
  return { ...bounds, subject: { ...subject, center: toWorld(subject.center) } };
}

/** Returns [N, 3] positions of some splats. */
function placesOf(positions: Float32Array, indices: readonly number[]): Float32Array {
  const places = new Float32Array(3 * indices.length);
  let at = 0;
  for (const i of indices) for (let axis = 0; axis < 3; axis++) places[at++] = positions[3 * i + axis];
  return places;
}

function axisOf(places: Float32Array, axis: number): Float32Array {
  const values = new Float32Array(places.length / 3);
  for (let k = 0; k < values.length; k++) values[k] = places[3 * k + axis];
  return values;
}

function distancesTo(places: Float32Array, [x, y, z]: readonly number[]): Float64Array {
  const distances = new Float64Array(places.length / 3);
  for (let k = 0; k < distances.length; k++)
    distances[k] = Math.sqrt((places[3 * k] - x) ** 2 + (places[3 * k + 1] - y) ** 2 + (places[3 * k + 2] - z) ** 2);
  return distances;
}

function within(places: Float32Array, distances: Float64Array, end: number): Float32Array {
  const kept = new Float32Array(places.length);
  let at = 0;
  for (let k = 0; k < distances.length; k++)
    if (distances[k] <= end) for (let axis = 0; axis < 3; axis++) kept[at++] = places[3 * k + axis];
  return kept.subarray(0, at);
}

/** Returns the minimum and the maximum of each coordinate over [N, 3] positions. */
function boxOf(positions: Float32Array): [number[], number[]] {
  const [min, max] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (let axis = 0; axis < 3; axis++) {
    let lowest = Infinity;
    let highest = -Infinity;
    for (let i = axis; i < positions.length; i += 3) {
      const place = positions[i];
      if (place < lowest) lowest = place;
      if (place > highest) highest = place;
    }
    [min[axis], max[axis]] = [lowest, highest];
  }
  return [min, max];
}

/** Returns the smallest sphere around the points whose center is that of their box. */
function ballAround(places: Float32Array): { center: number[]; radius: number } {
  const [min, max] = boxOf(places);
  const center = min.map((low, axis) => (low + max[axis]) / 2);
  return { center, radius: distancesTo(places, center).reduce((max, x) => Math.max(max, x), 0) };
}

/** Returns the indices of evenly spaced splats with an opacity of 0.1 or more; of all sampled ones if there are none. */
function sampleOpaque(opacities: Float32Array, count: number): number[] {
  const step = Math.max(1, Math.floor(count / SAMPLE_LIMIT));
  const all = Array.from({ length: Math.ceil(count / step) }, (_, k) => k * step);
  const opaque = all.filter((i) => opacities[i] >= 0.1);
  return opaque.length > 0 ? opaque : all;
}

const quantile = (sorted: Float64Array | Float32Array, share: number): number =>
  sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
