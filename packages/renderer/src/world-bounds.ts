import type { Ball, Bounds, Matrix4, Vector3 } from '@gaussian-splat/core';
import type { Box, Placed, World } from './world.js';

/**
 * Returns the bounds in world units of the visible scenes of a world whose bounds are known; undefined if there are
 * none.
 */
export function boundsOfWorld({ placements }: Pick<World, 'placements'>): Bounds | undefined {
  const all = placements.flatMap((placement) => {
    const { bounds, visible } = placement;
    return bounds && visible ? [placedBounds(bounds, placement)] : [];
  });
  return all.length > 0 ? all.reduce(union) : undefined;
}

/** Transforms a point from scene to world coordinates; `m` is undefined for the identity. */
function inWorld(m: Matrix4 | undefined, [x, y, z]: Vector3): Vector3 {
  if (m === undefined) return [x, y, z];
  const row = (r: number): number => m[r] * x + m[r + 1] * y + m[r + 2] * z + m[r + 3];
  return [row(0), row(4), row(8)];
}

function placedBounds(bounds: Bounds, { sceneToWorld: m, crop }: Placed): Bounds {
  const cropped = crop ? cut(bounds, crop) : bounds;
  if (m === undefined) return cropped;
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => {
    const side = (axis: number): number => ((k >> axis) & 1 ? cropped.max : cropped.min)[axis];
    return inWorld(m, [side(0), side(1), side(2)]);
  });
  const of = (choose: (...values: number[]) => number): Vector3 => {
    const at = (axis: number): number => choose(...corners.map((corner) => corner[axis]));
    return [at(0), at(1), at(2)];
  };
  const stretch = Math.max(...[0, 1, 2].map((column) => Math.hypot(m[column], m[4 + column], m[8 + column])));
  const { subject, inside } = cropped;
  const ball = ({ center, radius }: Ball): Ball => ({ center: inWorld(m, center), radius: radius * stretch });
  return {
    ...{ min: of(Math.min), max: of(Math.max), ...ball(cropped), ...(subject && { subject: ball(subject) }) },
    ...(inside && { inside: { ...ball(inside), toward: inWorld(m, inside.toward) } }),
  };
}

/** Returns the bounds of a cropped scene, in its own coordinates. */
function cut(bounds: Bounds, crop: Box): Bounds {
  const clamp = (p: Vector3): Vector3 => {
    const at = (axis: number): number => Math.min(crop.max[axis], Math.max(crop.min[axis], p[axis]));
    return [at(0), at(1), at(2)];
  };
  const [min, max] = [clamp(bounds.min), clamp(bounds.max)];
  const reach = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) / 2;
  const { center, radius } = bounds;
  // Moves the center of the sphere to the cropped part, so that a camera frames this part.
  const middle = (axis: number): number => {
    if (min[axis] === bounds.min[axis] && max[axis] === bounds.max[axis]) return center[axis];
    const from = Math.max(min[axis], Math.min(max[axis], center[axis] - radius));
    const to = Math.max(min[axis], Math.min(max[axis], center[axis] + radius));
    return (from + to) / 2;
  };
  return { min, max, center: [middle(0), middle(1), middle(2)], radius: Math.min(radius, reach) || radius };
}

/** Returns the bounds that contain both arguments. */
function union(a: Bounds, b: Bounds): Bounds {
  const pick = (choose: (x: number, y: number) => number, p: Vector3, q: Vector3): Vector3 => [
    choose(p[0], q[0]),
    choose(p[1], q[1]),
    choose(p[2], q[2]),
  ];
  const boxes = { min: pick(Math.min, a.min, b.min), max: pick(Math.max, a.max, b.max) };
  const subject = a.subject && b.subject && joined(a.subject, b.subject);
  const inside = a.inside ?? b.inside;
  return { ...boxes, ...joined(a, b), ...(subject && { subject }), ...(inside && { inside }) };
}

/** Returns the smallest sphere that contains both spheres. */
function joined(a: Ball, b: Ball): Ball {
  const [dx, dy, dz] = [0, 1, 2].map((axis) => b.center[axis] - a.center[axis]);
  const distance = Math.hypot(dx, dy, dz);
  if (distance + b.radius <= a.radius) return { center: a.center, radius: a.radius };
  if (distance + a.radius <= b.radius) return { center: b.center, radius: b.radius };
  const radius = (distance + a.radius + b.radius) / 2;
  const t = (radius - a.radius) / distance;
  return { center: [a.center[0] + t * dx, a.center[1] + t * dy, a.center[2] + t * dz], radius };
}
