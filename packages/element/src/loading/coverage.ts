import type { Bounds, GaussianCloud } from '@gaussian-splat/core';

/** Distance of the first camera, in radii of what it frames, and half of the frame's height there, in distances: a field of view of 45 degrees. */
const DISTANCE = 2.6;
const HALF_HEIGHT = 0.41;
/** Opacity of which nothing is drawn. */
const ALPHA_MIN = 1 / 255;

/**
 * How many times the splats of a cloud cover a frame as its first camera sees them: the sum of the shares of the frame that each covers. Captured scenes have some tens.
 */
export function coverageOf(
  { count, positions, scales, opacities, origin }: GaussianCloud,
  { center, radius }: Bounds,
): number {
  const [cx, cy, cz] = center.map((value, axis) => value - origin[axis]);
  let sum = 0;
  for (let i = 0; i < count; i++) {
    if (!(opacities[i] > ALPHA_MIN)) continue;
    const at = 3 * i;
    const away = Math.hypot(positions[at] - cx, positions[at + 1] - cy, positions[at + 2] - cz);
    const [a, b, c] = [scales[at], scales[at + 1], scales[at + 2]];
    // The two longest axes.
    const largest = Math.max(a, b, c);
    const middle = Math.max(Math.min(a, b), Math.min(Math.max(a, b), c));
    const sigmas = Math.sqrt(2 * Math.log(opacities[i] / ALPHA_MIN));
    const unit = sigmas / (HALF_HEIGHT * Math.max(DISTANCE * radius, away));
    const share = Math.min(1, largest * unit) * Math.min(1, middle * unit);
    if (share > 0) sum += share;
  }
  return sum;
}

/** Frames that the splats of a scene may cover at full size: some, and more for larger files. */
const FREE_FRAMES = 1_000;
const FRAMES_PER_SPLAT = 1 / 500;

/** How a scene whose frames would cost more than its bytes allow is drawn. */
export interface Overdraw {
  /** Share of the pixels of each side that are drawn, 0..1; absent for all. */
  readonly pixelShare?: number;
  readonly warnings: readonly string[] | undefined;
}

/** Limits the pixels of a frame so that all splats together cover a bounded number of them: the more they would cover, the fewer. */
export function limitOverdraw(cloud: GaussianCloud, bounds: Bounds): Overdraw {
  const { warnings = [], count } = cloud;
  const frames = coverageOf(cloud, bounds);
  const allowed = FREE_FRAMES + FRAMES_PER_SPLAT * count;
  if (frames <= allowed) return { warnings: cloud.warnings };
  const pixelShare = allowed / frames;
  const sentence =
    `Its splats cover a frame ${Math.round(frames)} times (${Math.round(allowed)} allowed): ` +
    `each side has ${(100 * pixelShare).toPrecision(2)} % of its pixels.`;
  return { pixelShare, warnings: [...warnings, sentence] };
}
