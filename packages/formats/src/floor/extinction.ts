import { GaussianSplatError, matrixOfQuaternion, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
import type { LoadLimits } from '../budget.js';
import { FloorWork } from './floor-work.js';

/** Rows of the rotation from the coordinates of a cloud to those with y up. */
export type UpFrame = readonly [Vector3, Vector3, Vector3];

/** Grid of cubic voxels in coordinates with y up, in meters. */
export interface VoxelGrid {
  /** Corner of the first voxel with the smallest coordinates, in meters. */
  readonly corner: Vector3;
  /** Number of voxels along x, y and z. */
  readonly size: readonly [nx: number, ny: number, nz: number];
  /** Edge of a voxel in meters. */
  readonly voxel: number;
}

/** Grid with the optical depth of a scene in each voxel, [nz, ny, nx]: sums of `-ln(1 - alpha)` over all splats. */
export interface ExtinctionGrid extends VoxelGrid {
  /** Mean optical depth of the surfaces in a voxel, times their area relative to a side of the voxel. */
  readonly values: Float32Array;
  /** Optical depth of the voxel for a vertical ray. A vertical wall has almost none. */
  readonly vertical: Float32Array;
}

export interface GridOptions {
  /** Meters in a unit of the scene; default 1. */
  readonly metersPerUnit?: number;
  readonly frame: UpFrame;
  /** Edge of a voxel in meters; default 0.05. It is larger if the scene would need more than {@link MAX_VOXELS}. */
  readonly voxel?: number;
  /** Point in meters with y up around which the grid is not cropped. */
  readonly near?: Vector3;
  /** Time limit; the work itself is always limited, to about a minute. */
  readonly limits?: Pick<LoadLimits, 'maxSeconds'>;
}

/** Maximum number of voxels of a grid, 128 MB of float32 for two optical depths. */
export const MAX_VOXELS = 2 ** 24;
/** Maximum number of splats that are added to a grid. Of more splats, an evenly spaced sample represents all. */
const MAX_SPLATS = 500_000;
/** Fraction of the splats that may be outside the grid on each side, so that distant outliers do not enlarge it. */
const OUTLIERS = 0.003;
/** Minimum fraction of the splats that remain in a grid that is cropped. With fewer, voxels become larger instead. */
const MIN_KEPT = 0.6;
/** Maximum number of centers that decide what is cropped. */
const MAX_SAMPLES = 20_000;
/** Fraction of its length by which a side of the grid is cropped at a time. */
const CROP = 0.04;
/** Distances in meters from the point `near` that remain in the grid: to the sides, below and above. */
const [KEPT_ASIDE, KEPT_BELOW, KEPT_ABOVE] = [3, 3, 1];
/** Number of voxels around the scene on each side of the grid. */
const MARGIN = 4;
const MIN_ALPHA = 1 / 255;
const MAX_ALPHA = 0.999;

/**
 * Returns the optical depths of a scene. Covariances are widened by the variance of a voxel, edge² / 12, so that thin walls
 * do not fall between voxel centers, but the optical depth that a splat adds to all voxels together stays the same.
 * @throws GaussianSplatError `argument/value` for lengths that are not positive and finite; `out-of-memory/budget` if
 * splats cover too many voxels, or the work exceeds its limits.
 */
export function extinctionOf(
  cloud: GaussianCloud,
  options: GridOptions,
  work = new FloorWork(options.limits),
): ExtinctionGrid {
  const { metersPerUnit = 1, frame } = options;
  for (const [name, value] of Object.entries({ metersPerUnit, voxel: options.voxel ?? 0.05 }))
    if (!(value > 0 && value < Infinity))
      throw new GaussianSplatError('argument/value', {
        where: name,
        expected: 'a positive length',
        found: String(value),
        remedy: 'pass meters, such as 0.05',
      });
  const step = Math.max(1, Math.ceil(cloud.count / MAX_SPLATS));
  const centers = centersOf(cloud, frame, metersPerUnit, step);
  const grid = emptyGrid(centers, options.voxel ?? 0.05, options.near);
  for (let k = 0, i = 0; i < cloud.count; k++, i += step)
    work.take(addSplat(grid, cloud, i, k, centers, frame, metersPerUnit, step));
  return grid;
}

/** Returns the centers of every `step`th splat, [N, 3], in meters with y up. */
function centersOf(cloud: GaussianCloud, frame: UpFrame, metersPerUnit: number, step: number): Float32Array {
  const { count, positions, origin } = cloud;
  const centers = new Float32Array(3 * Math.ceil(count / step));
  for (let k = 0, i = 0; i < count; k++, i += step) {
    const [x, y, z] = [0, 1, 2].map((axis) => positions[3 * i + axis] + origin[axis]);
    for (const axis of [0, 1, 2]) {
      const row = frame[axis];
      centers[3 * k + axis] = metersPerUnit * (row[0] * x + row[1] * y + row[2] * z);
    }
  }
  return centers;
}

type Ranges = readonly (readonly [low: number, high: number])[];

function emptyGrid(centers: Float32Array, wanted: number, near?: Vector3): ExtinctionGrid {
  const count = centers.length / 3;
  const whole = [0, 1, 2].map((axis) => {
    const sorted = Float32Array.from({ length: count }, (_, i) => centers[3 * i + axis]).sort();
    const last = Math.min(count - 1, Math.floor((1 - OUTLIERS) * count));
    return [sorted[Math.floor(OUTLIERS * count)] ?? 0, sorted[last] ?? 0] as const;
  });
  const sizeOf = (ranges: Ranges, voxel: number): Vector3 =>
    ranges.map(([low, high]) => Math.ceil((high - low) / voxel) + 2 * MARGIN) as unknown as Vector3;
  const isTooLarge = (ranges: Ranges, voxel: number): boolean =>
    sizeOf(ranges, voxel).reduce((product, length) => product * length) > MAX_VOXELS;
  let voxel = wanted;
  const ranges = cropped(whole, centers, (each) => isTooLarge(each, voxel), near);
  while (isTooLarge(ranges, voxel)) voxel *= 1.25;
  const size = sizeOf(ranges, voxel);
  const voxels = size[0] * size[1] * size[2];
  const corner = ranges.map(([low]) => low - MARGIN * voxel) as unknown as Vector3;
  return { values: new Float32Array(voxels), vertical: new Float32Array(voxels), corner, size, voxel };
}

/**
 * Crops ranges, again and again on the side with the fewest splats for its volume, so that the background and the tops of
 * trees are left out before voxels become larger.
 */
function cropped(
  whole: Ranges,
  centers: Float32Array,
  isTooLarge: (ranges: Ranges) => boolean,
  near?: Vector3,
): Ranges {
  const stride = 3 * Math.max(1, Math.ceil(centers.length / 3 / MAX_SAMPLES));
  const isIn = (at: number, ranges: Ranges): boolean =>
    ranges.every(([low, high], axis) => centers[at + axis] >= low && centers[at + axis] <= high);
  let inside: number[] = [];
  for (let at = 0; at < centers.length; at += stride) if (isIn(at, whole)) inside.push(at);
  const required = MIN_KEPT * inside.length;
  let ranges = whole;
  while (isTooLarge(ranges)) {
    let best: { readonly ranges: Ranges; readonly density: number } | undefined;
    for (const axis of [0, 1, 2])
      for (const side of [0, 1] as const) {
        const [low, high] = ranges[axis];
        const cut = CROP * (high - low);
        const [from, to] = side === 0 ? [low + cut, high] : [low, high - cut];
        if (near && Number.isFinite(near[axis])) {
          const [below, above] = axis === 1 ? [KEPT_BELOW, KEPT_ABOVE] : [KEPT_ASIDE, KEPT_ASIDE];
          if (side === 0 ? from > near[axis] - below : to < near[axis] + above) continue;
        }
        const count = inside.filter((at) => centers[at + axis] < from || centers[at + axis] > to).length;
        const density = (count * (high - low)) / cut;
        if (best && best.density <= density) continue;
        best = { ranges: ranges.map((range, k) => (k === axis ? ([from, to] as const) : range)), density };
      }
    if (best === undefined) return ranges;
    const remaining = inside.filter((at) => isIn(at, best.ranges));
    if (remaining.length < required) return ranges;
    [ranges, inside] = [best.ranges, remaining];
  }
  return ranges;
}

/**
 * Adds the optical depths of splat `i` to the grid.
 * @param k Index of the splat's center in `centers`.
 * @param share Number of splats that the splat represents.
 * @returns The number of voxels that the splat covers.
 */
function addSplat(
  { values, vertical, corner, size, voxel }: ExtinctionGrid,
  cloud: GaussianCloud,
  i: number,
  k: number,
  centers: Float32Array,
  frame: UpFrame,
  metersPerUnit: number,
  share: number,
): number {
  const alpha = Math.min(MAX_ALPHA, cloud.opacities[i]);
  if (!(alpha >= MIN_ALPHA)) return 0;
  const [vx, xy, xz, vy, yz, vz] = covarianceOf(cloud, i, frame, metersPerUnit);
  const widened = (voxel * voxel) / 12;
  const [xx, yy, zz] = [vx + widened, vy + widened, vz + widened];
  const [a, d, f] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
  const determinant = xx * a + xy * d + xz * f;
  if (!(determinant > 0)) return 0;
  const inverse = [a, d, f, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy].map((v) => v / determinant);
  const reach = Math.sqrt(2 * Math.log(alpha / MIN_ALPHA));
  // A ray along an axis crosses the splat's footprint on the two other axes; voxels share its optical depth.
  const scale = (share * massOf(alpha) * voxel) / Math.sqrt(2 * Math.PI * determinant);
  const footprint = (u: number, v: number, uv: number): number => scale * Math.sqrt(Math.max(0, u * v - uv * uv));
  const upward = footprint(vx, vz, xz);
  // A splat that is thicker than a voxel in all directions is haze or a floater rather than a surface.
  const { scales } = cloud;
  const thinnest = metersPerUnit * Math.min(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
  const surface = Math.min(1, voxel / (Math.sqrt(2 * Math.PI) * thinnest));
  const total = surface * Math.hypot(footprint(vy, vz, yz), upward, footprint(vx, vy, xy));
  const center = [centers[3 * k], centers[3 * k + 1], centers[3 * k + 2]];
  const extent = [xx, yy, zz].map((variance) => reach * Math.sqrt(variance));
  const first = (axis: number): number =>
    Math.max(0, Math.ceil((center[axis] - extent[axis] - corner[axis]) / voxel - 0.5));
  const last = (axis: number): number =>
    Math.min(size[axis] - 1, Math.floor((center[axis] + extent[axis] - corner[axis]) / voxel - 0.5));
  const [x0, x1, y0, y1, z0, z1] = [first(0), last(0), first(1), last(1), first(2), last(2)];
  const offset = (axis: number, index: number): number => corner[axis] + (index + 0.5) * voxel - center[axis];
  for (let z = z0; z <= z1; z++) {
    const dz = offset(2, z);
    for (let y = y0; y <= y1; y++) {
      const dy = offset(1, y);
      const rest = inverse[3] * dy * dy + inverse[5] * dz * dz + 2 * inverse[4] * dy * dz;
      const slope = 2 * (inverse[1] * dy + inverse[2] * dz);
      let at = x0 + size[0] * (y + size[1] * z);
      for (let x = x0; x <= x1; x++, at++) {
        const dx = offset(0, x);
        const density = Math.exp(-0.5 * (rest + dx * (slope + inverse[0] * dx)));
        values[at] += total * density;
        vertical[at] += upward * density;
      }
    }
  }
  return Math.max(0, x1 - x0 + 1) * Math.max(0, y1 - y0 + 1) * Math.max(0, z1 - z0 + 1);
}

/** Returns the integral of `-ln(1 - alpha exp(-r² / 2))` over the plane, divided by 2 pi: the dilogarithm of alpha. */
function massOf(alpha: number): number {
  let sum = 0;
  for (let k = 1, power = alpha; k <= 32 && power > 1e-6; k++, power *= alpha) sum += power / (k * k);
  return sum;
}

/** Returns the covariance of splat `i` in m² with y up: xx, xy, xz, yy, yz, zz. */
function covarianceOf(
  { rotations, scales }: GaussianCloud,
  i: number,
  frame: UpFrame,
  metersPerUnit: number,
): [number, number, number, number, number, number] {
  const m = matrixOfQuaternion(rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]);
  const sums: [number, number, number, number, number, number] = [0, 0, 0, 0, 0, 0];
  for (let axis = 0; axis < 3; axis++) {
    const scale = metersPerUnit * scales[3 * i + axis];
    const [a, b, c] = frame.map((row) => scale * (row[0] * m[axis] + row[1] * m[3 + axis] + row[2] * m[6 + axis]));
    sums[0] += a * a;
    sums[1] += a * b;
    sums[2] += a * c;
    sums[3] += b * b;
    sums[4] += b * c;
    sums[5] += c * c;
  }
  return sums;
}
