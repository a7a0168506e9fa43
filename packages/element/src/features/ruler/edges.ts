import { cross, dot, normalize, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { Aim, AimedSurface } from '../../viewer/position-from-point.js';

/** Rays of the ruler: a grid of this many a side, this many CSS pixels apart. */
const [SIDE, STEP] = [9, 6];
/** Distance in CSS pixels within which an end is moved to an edge or corner. */
const REACH = 10;
/** Distance from a plane, as a fraction of the depth, within which points are on it. */
const ON_PLANE = 0.012;
/** Minimum fraction of the rays that meet a plane. */
const MIN_SHARE = 0.12;
/** Maximum cosine of the angle of two planes that form an edge: 25 degrees or more. */
const MAX_COSINE = Math.cos((25 * Math.PI) / 180);

/** A plane in camera axes: `dot(normal, p) = offset`, with a unit normal. */
interface Plane {
  readonly normal: Vector3;
  readonly offset: number;
}

/**
 * Sets an end of the ruler on the plane around it, and on an edge or corner of such planes nearby. The
 * planes are those that most rays of a grid meet.
 */
export const edges: Aim = {
  points: (x, y, pixel) =>
    Array.from({ length: SIDE * SIDE }, (_, i) => ({
      x: x + STEP * pixel * ((i % SIDE) - (SIDE - 1) / 2),
      y: y + STEP * pixel * (Math.floor(i / SIDE) - (SIDE - 1) / 2),
    })),
  choose: (camera, at, points, answers, pixel) => {
    const met = answers.map(({ depth }, i) => depth && inCamera(camera, points[i].x, points[i].y, depth));
    const first = planesIn(met, at.normal, inCamera(camera, at.x, at.y, at.depth));
    if (first.length === 0) return at;
    const own = { ...at, normal: first[0].normal };
    if (!Number.isFinite(at.uncertainty)) return own;
    const near = (found: AimedSurface | undefined): found is AimedSurface =>
      found !== undefined && Math.hypot(found.x - at.x, found.y - at.y) <= REACH * pixel;
    return (
      [cornerOf(camera, own, first), ...first.slice(1).map((other) => edgeOf(camera, own, first[0], other))].find(
        near,
      ) ?? own
    );
  },
};

function inCamera({ fx, fy, cx, cy, orthographic }: Camera, x: number, y: number, depth: number): Vector3 {
  const stretch = orthographic ? 1 : depth;
  return [((x - cx) / fx) * stretch, ((y - cy) / fy) * stretch, depth];
}

function inImage(
  { fx, fy, cx, cy, orthographic }: Camera,
  [x, y, z]: Vector3,
): { x: number; y: number; depth: number } {
  const shrink = orthographic ? 1 : z;
  return { x: (fx * x) / shrink + cx, y: (fy * y) / shrink + cy, depth: z };
}

/**
 * Returns up to three planes that the rays meet, first the one through the picked point. Each later plane is the one
 * that most of the remaining rays meet, of those through three rays nearby.
 */
function planesIn(met: readonly (Vector3 | null | 0)[], normal: Vector3, through: Vector3): Plane[] {
  const isOn = ({ normal: n, offset }: Plane, p: Vector3): boolean => Math.abs(dot(n, p) - offset) < ON_PLANE * p[2];
  let rest = met.flatMap((p, i) => (p ? [{ p, i }] : []));
  const enough = MIN_SHARE * met.length;
  const planes: Plane[] = [];
  let next: Plane | undefined = { normal, offset: dot(normal, through) };
  while (next && planes.length < 3) {
    const start: Plane = next;
    const on: Vector3[] = rest.flatMap(({ p }) => (isOn(start, p) ? [p] : []));
    const plane = on.length >= enough ? fitted(on, start) : undefined;
    if (plane) planes.push(plane);
    else if (planes.length === 0) return [];
    rest = rest.filter(({ p }) => !isOn(plane ?? start, p) && !isOn(start, p));
    const places = new Map(rest.map(({ p, i }) => [i, p]));
    let best = enough;
    next = undefined;
    for (const { p, i } of rest) {
      const [right, down] = [places.get(i + 2), places.get(i + 2 * SIDE)];
      if (!right || !down || (i % SIDE) + 2 >= SIDE) continue;
      const turned = cross(subtract(right, p), subtract(down, p));
      if (!(Math.hypot(...turned) > 0)) continue;
      const tried = facing({ normal: normalize(turned), offset: dot(normalize(turned), p) });
      if (planes.some((each) => Math.abs(dot(each.normal, tried.normal)) > MAX_COSINE)) continue;
      const count = rest.filter((each) => isOn(tried, each.p)).length;
      if (count >= best) [best, next] = [count + 1, tried];
    }
  }
  return planes;
}

/** Returns the plane with its normal towards the camera. */
const facing = ({ normal, offset }: Plane): Plane =>
  normal[2] <= 0 ? { normal, offset } : { normal: [-normal[0], -normal[1], -normal[2]], offset: -offset };

/** Fits a plane by least squares along the axis that its first guess faces. */
function fitted(points: readonly Vector3[], { normal }: Plane): Plane {
  const [u, v] = [0, 1, 2].sort((a, b) => Math.abs(normal[a]) - Math.abs(normal[b]));
  const w = 3 - u - v;
  const middle = [0, 1, 2].map((k) => points.reduce((sum, p) => sum + p[k], 0) / points.length) as unknown as Vector3;
  let [uu, uv, vv, uw, vw] = [1e-12, 0, 1e-12, 0, 0];
  for (const p of points) {
    const [a, b, c] = [p[u] - middle[u], p[v] - middle[v], p[w] - middle[w]];
    [uu, uv, vv, uw, vw] = [uu + a * a, uv + a * b, vv + b * b, uw + a * c, vw + b * c];
  }
  const size = uu * vv - uv * uv;
  const found: [number, number, number] = [0, 0, 0];
  found[u] = (uw * vv - vw * uv) / size;
  found[v] = (vw * uu - uw * uv) / size;
  found[w] = -1;
  const unit = normalize(found);
  return facing({ normal: unit, offset: dot(unit, middle) });
}

/** Returns the point of the line of two planes that is nearest in the image. */
function edgeOf(camera: Camera, at: AimedSurface, a: Plane, b: Plane): AimedSurface | undefined {
  const along = cross(a.normal, b.normal);
  const sine = Math.hypot(...along);
  if (sine === 0) return undefined;
  const through = meeting(a, b, {
    normal: normalize(along),
    offset: dot(normalize(along), inCamera(camera, at.x, at.y, at.depth)),
  });
  if (!through || through[2] <= 0) return undefined;
  const step = (0.05 * at.depth) / sine;
  const ends = [-step, step].map((s) => inImage(camera, through.map((c, k) => c + s * along[k]) as unknown as Vector3));
  if (ends.some(({ depth }) => depth <= 0)) return undefined;
  const [{ x, y }, to] = ends;
  const [dx, dy] = [to.x - x, to.y - y];
  const share = ((at.x - x) * dx + (at.y - y) * dy) / Math.max(dx * dx + dy * dy, 1e-12);
  const place = { x: x + share * dx, y: y + share * dy };
  const depth = depthOn(camera, a, place);
  return depth > 0 ? { ...place, depth, normal: at.normal, uncertainty: at.uncertainty / sine } : undefined;
}

/** Returns the point that three planes share. */
function cornerOf(camera: Camera, at: AimedSurface, planes: readonly Plane[]): AimedSurface | undefined {
  const [a, b, c] = planes;
  const place = c && meeting(a, b, c);
  if (!place || place[2] <= 0) return undefined;
  const sine = Math.abs(dot(a.normal, cross(b.normal, c.normal)));
  return { ...inImage(camera, place), normal: at.normal, uncertainty: at.uncertainty / sine };
}

/** Returns the depth of a plane at a pixel. */
function depthOn(
  camera: Camera,
  { normal, offset }: Plane,
  { x, y }: { readonly x: number; readonly y: number },
): number {
  const [near, far] = [inCamera(camera, x, y, 0), inCamera(camera, x, y, 1)];
  return (offset - dot(normal, near)) / dot(normal, subtract(far, near));
}

function meeting(a: Plane, b: Plane, c: Plane): Vector3 | undefined {
  const size = dot(a.normal, cross(b.normal, c.normal));
  if (Math.abs(size) < 1e-3) return undefined;
  const parts = [cross(b.normal, c.normal), cross(c.normal, a.normal), cross(a.normal, b.normal)];
  return [0, 1, 2].map(
    (k) => (a.offset * parts[0][k] + b.offset * parts[1][k] + c.offset * parts[2][k]) / size,
  ) as unknown as Vector3;
}
