import type { PickedPoint } from '../../viewer/camera/values.js';

/** Minimum cosine of the angle of two surfaces that count as parallel: 12 degrees. */
const PARALLEL = Math.cos((12 * Math.PI) / 180);
/** Distance of surfaces that face the same way, as a fraction of the length, below which they count as one. */
const SAME_SURFACE = 1 / 3;

type End = Pick<PickedPoint, 'x' | 'y' | 'z' | 'normal'>;

/**
 * Returns the distance of two surfaces at right angles to them; null unless they are parallel. Two that face the same way,
 * and are hardly apart, may be one surface whose normals are not exact.
 */
export function perpendicularOf(from: End, to: End): number | null {
  const [a, b] = [from.normal, to.normal];
  const cosine = a.x * b.x + a.y * b.y + a.z * b.z;
  if (Math.abs(cosine) < PARALLEL) return null;
  const sign = Math.sign(cosine);
  const n = [a.x + sign * b.x, a.y + sign * b.y, a.z + sign * b.z];
  const way = [to.x - from.x, to.y - from.y, to.z - from.z];
  const apart = Math.abs(n[0] * way[0] + n[1] * way[1] + n[2] * way[2]) / Math.hypot(...n);
  return sign > 0 && apart < SAME_SURFACE * Math.hypot(...way) ? null : apart;
}
