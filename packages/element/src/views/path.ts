/** Ways from pose to pose. Pure. */
import type { Pose } from '../camera/orbit.js';

/** How a flight sets out and arrives: a name as in CSS, or a function of 0..1. */
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

/** The same view with its azimuth at most half a turn from another's. */
export function unwound(pose: Pose, before: Pose): Pose {
  const turns = Math.round((pose.theta - before.theta) / (2 * Math.PI));
  return turns === 0 ? pose : { ...pose, theta: pose.theta - turns * 2 * Math.PI };
}

/** Distances go by factors: half of the way from 1 m to 4 m is 2 m. */
const rise = (pose: Pose, key: (typeof KEYS)[number]): number => (key === 'radius' ? Math.log(pose.radius) : pose[key]);

/**
 * A smooth path through poses: Catmull and Rom's cubic through values and times.
 * @param times one for each pose, rising.
 * @param time clamped to those.
 * @returns exactly a pose at its own time
 */
export function poseAlong(poses: readonly Pose[], times: readonly number[], time: number): Pose {
  const last = poses.length - 1;
  const chain = poses.reduce<Pose[]>((done, pose, i) => [...done, i === 0 ? pose : unwound(pose, done[i - 1])], []);
  if (last === 0 || time <= times[0]) return chain[0];
  if (!(time < times[last])) return chain[last];
  const i = times.findIndex((next, k) => k < last && time < times[k + 1] && time >= next);
  const step = times[i + 1] - times[i];
  const t = (time - times[i]) / step;
  if (t === 0) return chain[i];
  const slope = (k: number, key: (typeof KEYS)[number]): number => {
    // At its ends the path sets out and arrives straight.
    const [a, b] = [Math.max(0, k - 1), Math.min(last, k + 1)];
    return (rise(chain[b], key) - rise(chain[a], key)) / (times[b] - times[a]);
  };
  const at = (key: (typeof KEYS)[number]): number => {
    const [from, to] = [rise(chain[i], key), rise(chain[i + 1], key)];
    const [out, into] = [slope(i, key) * step, slope(i + 1, key) * step];
    const value =
      from + t * out + t * t * (3 * (to - from) - 2 * out - into) + t * t * t * (2 * (from - to) + out + into);
    return key === 'radius' ? Math.exp(value) : value;
  };
  return Object.fromEntries(KEYS.map((key) => [key, at(key)])) as unknown as Pose;
}
