import { normalize, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint } from './depth-probe.js';
import { constants } from './generated/shaders.js';

/** Offsets of the rays around a picked point, in {@link RAY_STEPS} of the smaller side of the image. */
const OFFSETS = [-3, -1, 0, 1, 3];
const RAY_STEPS = 300;
/** Standard deviation of the weights of rays, in the same steps. */
const RAY_SIGMA = 2.5;
/**
 * Width of the band around a plane whose layers belong to the plane, as a fraction of the distance, or of the height of
 * an orthographic image: for the visible layers, and minimum and maximum for hidden layers.
 */
const [BAND, MIN_BAND, MAX_BAND] = [0.02, 0.004, 0.03];
/** Exponent of the light by which hidden layers count: 1 would ignore them, and 0 would count all layers equally. */
const HIDDEN = 0.3;
/** Fraction of the light that the stated interval contains: chosen so that 68 % of intervals contain the surface. */
const WITHIN = 0.7;
/** Ray steps by which a surface may be aside of its splats: on a leaning surface they change the depth. */
const ASIDE = 1;
/** Minimum fraction of the light around the point that the surface of the point returns. */
const MIN_SUPPORT = 0.2;
/** Fraction of the light of a second surface on the ray, from which the first is glass. */
const SECOND = 0.25;
/** Thickness, as a fraction of the distance, from which a single splat is a ball and no surface. */
const BALL = 0.005;
const ROUNDS = 6;
const { PROBE_LEVELS } = constants;

/** The surface around a point of the image. */
export interface PickedSurface {
  /** Depth of the surface at the point, along the optical axis, in world units. */
  readonly depth: number;
  /**
   * Half of the interval of depths, in world units, that contains the surface in 68 % of the cases or more. Infinity if
   * the splats do not show one surface: at glass, at haze, and on a splat that nothing surrounds.
   */
  readonly uncertainty: number;
  /** Unit normal of the surface in camera axes (x right, y down, z forward), towards the camera. */
  readonly normal: Vector3;
}

/** The surface at a point, in the world of the camera. */
export interface PickedPlace {
  /** World units. */
  readonly position: Vector3;
  /** Unit normal of the surface, towards the camera. */
  readonly normal: Vector3;
  /** Distance from the camera, in world units. */
  readonly distance: number;
  /** {@link PickedSurface.uncertainty}, along the line of sight. */
  readonly uncertainty: number;
}

/** Converts a surface at a point of the image, in pixels, to the world. */
export function placeOfSurface(
  { worldToCamera: m, fx, fy, cx, cy, orthographic }: Camera,
  x: number,
  y: number,
  { depth, normal, uncertainty }: PickedSurface,
): PickedPlace {
  const turned = (v: Vector3): Vector3 =>
    [0, 1, 2].map((k) => m[k] * v[0] + m[4 + k] * v[1] + m[8 + k] * v[2]) as unknown as Vector3;
  const stretch = orthographic ? 1 : depth;
  const [across, down] = [(stretch * (x - cx)) / fx, (stretch * (y - cy)) / fy];
  const distance = orthographic ? depth : Math.hypot(across, down, depth);
  const position = turned([across - m[3], down - m[7], depth - m[11]]);
  return { position, normal: turned(normal), distance, uncertainty: (uncertainty * distance) / depth };
}

/** Fraction of the light that is left behind a layer of a probe: `light_left` of `shaders/shared/probe_levels.wgsl`. */
const lightLeft = (level: number): number => (level < 9 ? (9 - level) / 10 : 0.1 * 2 ** (8 - level));

/** Returns the points to probe for the surface at a point of the image; the first is the point itself. */
export function surfacePoints({ width, height }: Pick<Camera, 'width' | 'height'>, x: number, y: number): ProbePoint[] {
  const step = Math.min(width, height) / RAY_STEPS;
  const around = OFFSETS.flatMap((down) => OFFSETS.map((across) => ({ x: x + step * across, y: y + step * down })));
  return [{ x, y }, ...around.filter((_, i) => i !== (around.length - 1) / 2)];
}

/** A layer of the splats on one ray. */
interface Layer {
  readonly depth: number;
  /** Offset of the ray from the point, in ray steps. */
  readonly across: number;
  readonly down: number;
  /** Light that the layer returns, and its weight as a part of the surface, which hidden layers have too. */
  readonly light: number;
  readonly weight: number;
}

/**
 * Finds the surface at a point: the plane that most of the returned light around the point comes from. The plane is
 * found as the mode of the depths, and by weighted least squares in a band around it. Its depth is the middle of all
 * layers in this band, also of hidden ones: the visible layers of a rough surface are those nearest to the camera.
 * @param points Points of {@link surfacePoints}.
 * @returns null if half of the light or more passes the splats at the point
 */
export function pickedSurface(
  camera: Camera,
  points: readonly ProbePoint[],
  answers: readonly ProbeAnswer[],
): PickedSurface | null {
  const [{ x, y }] = points;
  const [center] = answers;
  if (!center || center.depth === null) return null;
  const step = Math.min(camera.width, camera.height) / RAY_STEPS;
  const rays = answers.map(({ layers }, i) => layersOf(layers, (points[i].x - x) / step, (points[i].y - y) / step));
  const all = rays.flat();
  const inner = all.filter(({ across, down }) => Math.hypot(across, down) < 2);
  const start = modeOf(inner, camera);
  const scale = scaleOf(camera, start);
  const visible = fit(all, scale, 'light', BAND, [0, 0, 0]);
  const found = fit(all, scale, 'weight', bandOf(all, scale, visible), visible);
  const [depth, seen] = [found, visible].map(([offset]) => scale.depthAt(offset));
  const aside = depth - scale.depthAt(found[0] + ASIDE * Math.hypot(found[1], found[2]));
  return {
    depth,
    uncertainty: isSurface(all, rays[0], answers, scale, found)
      ? Math.hypot(within(all, points.length, scale, found), depth - seen, aside, center.thickness)
      : Infinity,
    normal: normalOf(camera, x, y, step, scale, found),
  };
}

function layersOf(depths: ArrayLike<number>, across: number, down: number): Layer[] {
  const ray = rayWeight(across, down);
  const layers: Layer[] = [];
  for (let level = 0; level < PROBE_LEVELS && depths[level] > 0; level++) {
    const [before, after] = [level === 0 ? 1 : lightLeft(level - 1), lightLeft(level)];
    const weight = ray * (before ** HIDDEN - after ** HIDDEN);
    layers.push({ depth: depths[level], across, down, light: ray * (before - after), weight });
  }
  return layers;
}

const rayWeight = (across: number, down: number): number => Math.exp(-(across ** 2 + down ** 2) / (2 * RAY_SIGMA ** 2));

/**
 * Converts depths to numbers that are linear over the image on a plane, relative to a depth: nearness in perspective,
 * depth in an orthographic image.
 */
interface Scale {
  readonly offsetOf: (depth: number) => number;
  readonly depthAt: (offset: number) => number;
  /** Difference of depth for each offset, in parallel projection; 0 in perspective. */
  readonly size: number;
}

function scaleOf({ orthographic, height, fy }: Camera, from: number): Scale {
  const size = height / fy;
  return orthographic
    ? { offsetOf: (z) => (from - z) / size, depthAt: (offset) => from - offset * size, size }
    : { offsetOf: (z) => from / z - 1, depthAt: (offset) => from / (1 + offset), size: 0 };
}

/** Returns the depth around which most light is returned. */
function modeOf(layers: readonly Layer[], { orthographic, height, fy }: Camera): number {
  const places = layers.map(({ depth }) => (orthographic ? (depth * fy) / height : Math.log(depth)) / BAND);
  let [best, mode] = [0, 0];
  places.forEach((place, i) => {
    const light = layers.reduce((sum, other, j) => sum + other.light * bell(place - places[j]), 0);
    if (light > best) [best, mode] = [light, layers[i].depth];
  });
  return mode;
}

const bell = (x: number): number => Math.exp(-(x * x) / 2);

/** Offset at the point, and its slopes across and down for each ray step. */
type Plane = readonly [number, number, number];

const residual = ({ depth, across, down }: Layer, { offsetOf }: Scale, [offset, x, y]: Plane): number =>
  offsetOf(depth) - offset - x * across - y * down;

/** Fits a plane to the layers in a band around it. */
function fit(layers: readonly Layer[], scale: Scale, by: 'light' | 'weight', band: number, start: Plane): Plane {
  let plane = start;
  for (let round = 0; round < ROUNDS; round++) {
    let [n, sx, sy, xx, xy, yy, s, tx, ty] = [1e-9, 0, 0, 0, 0, 0, 0, 0, 0];
    for (const layer of layers) {
      const { across: x, down: y } = layer;
      const weight = layer[by] * bell(residual(layer, scale, plane) / band);
      const offset = weight * scale.offsetOf(layer.depth);
      [n, sx, sy, s] = [n + weight, sx + weight * x, sy + weight * y, s + offset];
      [xx, xy, yy] = [xx + weight * x * x, xy + weight * x * y, yy + weight * y * y];
      [tx, ty] = [tx + offset * x, ty + offset * y];
    }
    // A little ridge: rays on one line leave a slope open.
    [xx, yy] = [xx + 0.01 * n, yy + 0.01 * n];
    const [a, b, c] = [xx * yy - xy * xy, xy * sy - sx * yy, sx * xy - xx * sy];
    const size = n * a + sx * b + sy * c;
    plane = [
      (s * a + tx * b + ty * c) / size,
      (s * b + tx * (n * yy - sy * sy) + ty * (sx * sy - n * xy)) / size,
      (s * c + tx * (sx * sy - n * xy) + ty * (n * xx - sx * sx)) / size,
    ];
  }
  return plane;
}

/** Returns the band for hidden layers: the standard deviation of the light in the band of the visible ones. */
function bandOf(layers: readonly Layer[], scale: Scale, plane: Plane): number {
  let [sum, squares] = [0, 0];
  for (const layer of layers) {
    const off = residual(layer, scale, plane);
    const weight = layer.light * bell(off / BAND);
    [sum, squares] = [sum + weight, squares + weight * off * off];
  }
  return Math.min(MAX_BAND, Math.max(MIN_BAND, Math.sqrt(squares / sum)));
}

/** Returns the distance from the plane, in world units, within which the splats return {@link WITHIN} of the light. */
function within(layers: readonly Layer[], rays: number, scale: Scale, plane: Plane): number {
  const depth = scale.depthAt(plane[0]);
  const off = layers.map((layer) => [Math.abs(residual(layer, scale, plane)), layer.light] as const);
  off.sort(([a], [b]) => a - b);
  let light = WITHIN * totalOf(rays);
  const last = off.find((each) => (light -= each[1]) <= 0);
  if (!last) return Infinity;
  return Math.abs(scale.depthAt(plane[0] - Math.min(last[0], 0.9)) - depth);
}

/** Light of all rays. */
const totalOf = (rays: number): number =>
  rays === 1 ? 1 : OFFSETS.reduce((sum, a) => sum + OFFSETS.reduce((row, b) => row + rayWeight(a, b), 0), 0);

/** Whether the splats show one surface, which more than one ray and more than one ball meet. */
function isSurface(
  layers: readonly Layer[],
  ray: readonly Layer[],
  answers: readonly ProbeAnswer[],
  scale: Scale,
  plane: Plane,
): boolean {
  const near = 2 * BAND;
  const onPlane = layers.reduce((sum, l) => sum + (Math.abs(residual(l, scale, plane)) < near ? l.light : 0), 0);
  if (onPlane < MIN_SUPPORT * totalOf(answers.length)) return false;
  const [center] = answers;
  const isAlone = answers.every(({ splat }) => splat === null || splat.index === center.splat?.index);
  if (center.splat && isAlone && center.thickness > BALL * center.depth!) return false;
  // Light from before or behind the surface, with a gap between.
  return [1, -1].every((side) => {
    const beyond = ray.map((l) => [side * residual(l, scale, plane), l.light] as const).filter(([off]) => off > near);
    const light = beyond.reduce((sum, [, each]) => sum + each, 0);
    return light < SECOND || beyond.some(([off]) => off < 2 * near);
  });
}

function normalOf(
  { fx, fy, cx, cy }: Camera,
  x: number,
  y: number,
  step: number,
  { size }: Scale,
  [offset, perX, perY]: Plane,
): Vector3 {
  const [a, b] = [perX / step, perY / step];
  const normal: Vector3 =
    size > 0 ? [-a * fx * size, -b * fy * size, -1] : [-a * fx, -b * fy, a * (x - cx) + b * (y - cy) - 1 - offset];
  return normalize(normal);
}
