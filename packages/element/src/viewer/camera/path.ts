/** Interpolation of paths between poses. Independent of the DOM. */
import type { CameraPose } from './orbit.js';

/** Acceleration and deceleration of a flight: a CSS easing name, or a function of 0..1. */
export type Easing = 'linear' | 'ease-in' | 'ease-out' | 'ease-in-out' | ((share: number) => number);

const EASINGS: Readonly<Record<Extract<Easing, string>, (share: number) => number>> = {
  linear: (t) => t,
  'ease-in': (t) => t * t,
  'ease-out': (t) => t * (2 - t),
  'ease-in-out': (t) => t * t * (3 - 2 * t),
};

export const easingOf = (easing: Easing): ((share: number) => number) =>
  typeof easing === 'function' ? easing : (EASINGS[easing] ?? EASINGS['ease-in-out']);

const KEYS = ['theta', 'phi', 'radius', 'x', 'y', 'z', 'fieldOfView'] as const;

/** Returns the same view with an azimuth that differs from that of `before` by at most half a turn. */
export function unwound(pose: CameraPose, before: CameraPose): CameraPose {
  const turns = Math.round((pose.theta - before.theta) / (2 * Math.PI));
  return turns === 0 ? pose : { ...pose, theta: pose.theta - turns * 2 * Math.PI };
}

/** Value of a component for interpolation. Distances are interpolated geometrically: halfway from 1 m to 4 m is 2 m. */
const rise = (pose: CameraPose, key: (typeof KEYS)[number]): number =>
  key === 'radius' ? Math.log(pose.radius) : pose[key];

/** Returns the pose at a time. */
export type Path = (time: number) => CameraPose;

/**
 * Returns a smooth path through poses: a Catmull-Rom cubic through values and times. At the time of a pose the path
 * returns exactly that pose, and it clamps other times to the range.
 * @param times Ascending times, one per pose.
 */
export function pathThrough(poses: readonly CameraPose[], times: readonly number[]): Path {
  const last = poses.length - 1;
  const chain: CameraPose[] = [];
  for (const pose of poses) chain.push(chain.length === 0 ? pose : unwound(pose, chain[chain.length - 1]));
  const slope = (k: number, key: (typeof KEYS)[number]): number => {
    // At the ends of the path, the slope is that of the straight line to the neighbor.
    const [a, b] = [Math.max(0, k - 1), Math.min(last, k + 1)];
    return (rise(chain[b], key) - rise(chain[a], key)) / (times[b] - times[a] || 1);
  };
  return (time) => {
    if (last === 0 || time <= times[0]) return chain[0];
    if (!(time < times[last])) return chain[last];
    const i = indexBefore(times, time);
    const step = times[i + 1] - times[i];
    const t = (time - times[i]) / step;
    if (t === 0) return chain[i];
    const at = (key: (typeof KEYS)[number]): number => {
      const [from, to] = [rise(chain[i], key), rise(chain[i + 1], key)];
      const [out, into] = [slope(i, key) * step, slope(i + 1, key) * step];
      const value =
        from + t * out + t * t * (3 * (to - from) - 2 * out - into) + t * t * t * (2 * (from - to) + out + into);
      return key === 'radius' ? Math.exp(value) : value;
    };
    return Object.fromEntries(KEYS.map((key) => [key, at(key)])) as unknown as CameraPose;
  };
}

/**
 * Returns, by bisection, an index `i` with `times[i] <= time < times[i + 1]`, for a time between the first and the
 * last.
 */
function indexBefore(times: readonly number[], time: number): number {
  let [low, high] = [0, times.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return low;
}
