/** Fingers on a phone's screen during an AR session, as points of the plane on which the subject stands or hangs. */
import { cross, dot, type Vector3 } from '@gaussian-splat/core';
import type { XrFrame, XrInput, XrSpace } from './webxr.js';

/**
 * Maximum length of a finger's ray, meters. Rays that are almost parallel to the plane meet it far away, where the
 * subject would be lost.
 */
const REACH = 10;

/** Plane with two perpendicular unit axes, in the reference space of the session. */
export interface Plane {
  readonly point: Vector3;
  readonly axes: readonly [Vector3, Vector3];
}

/** Coordinates along the axes of a plane, meters. */
interface PlanePoint {
  readonly u: number;
  readonly v: number;
}

/** The first two fingers: their middle, and the angle in radians and the distance from the first to the second. */
export interface Fingers extends PlanePoint {
  readonly count: number;
  readonly angle: number;
  readonly apart: number;
}

/** Returns the fingers whose rays meet the plane within reach; undefined if there are none. */
export function fingersOn(plane: Plane, frame: XrFrame, space: XrSpace): Fingers | undefined {
  const [a, b = a] = [...frame.session.inputSources].flatMap((input) => pointOf(plane, frame, space, input) ?? []);
  if (!a) return undefined;
  const [du, dv] = [b.u - a.u, b.v - a.v];
  const middle = { u: (a.u + b.u) / 2, v: (a.v + b.v) / 2 };
  return { count: a === b ? 1 : 2, ...middle, angle: Math.atan2(dv, du), apart: Math.hypot(du, dv) };
}

function pointOf(
  { point: [x, y, z], axes: [first, second] }: Plane,
  frame: XrFrame,
  space: XrSpace,
  { targetRayMode, targetRaySpace }: XrInput,
): PlanePoint | undefined {
  if (targetRayMode !== 'screen') return undefined;
  const m = frame.getPose(targetRaySpace, space)?.transform.matrix;
  if (!m) return undefined;
  const normal = cross(first, second);
  const far = dot(normal, [m[12] - x, m[13] - y, m[14] - z]) / dot(normal, [m[8], m[9], m[10]]);
  const met: Vector3 = [m[12] - far * m[8], m[13] - far * m[9], m[14] - far * m[10]];
  return far > 0 && far <= REACH ? { u: dot(first, met), v: dot(second, met) } : undefined;
}
