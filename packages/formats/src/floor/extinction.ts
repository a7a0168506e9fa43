import { GaussianSplatError, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';
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

/** Grid with the optical depth of a scene in each voxel. */
export interface ExtinctionGrid extends VoxelGrid {
  /** Optical depths, [nz, ny, nx]: sums of `-ln(1 - alpha)` over all splats. */
  readonly values: Float32Array;
}

export interface GridOptions {
  /** Meters in a unit of the scene; default 1. */
  readonly metersPerUnit?: number;
  readonly frame: UpFrame;
  /** Edge of a voxel in meters; default 0.05. It is larger if the scene would need more than {@link MAX_VOXELS}. */
  readonly voxel?: number;
  /** Time limit; the work itself is always limited, to about a minute. */
  readonly limits?: Pick<LoadLimits, 'maxSeconds'>;
}

/** Maximum number of voxels of a grid, 64 MB of float32. */
export const MAX_VOXELS = 2 ** 24;
/** Maximum number of splats that are added to a grid. Of more splats, an evenly spaced sample represents all. */
const MAX_SPLATS = 500_000;
/**
 * Fractions of the splats that may be outside the grid on each side, so that distant outliers do not enlarge it. The first
 * one with which the grid has at most {@link MAX_VOXELS} is used.
 */
const OUTLIERS = [0.003, 0.006, 0.01, 0.015, 0.025, 0.04, 0.06, 0.1, 0.15] as const;
/** Number of voxels around the scene on each side of the grid. */
const MARGIN = 4;
const MIN_ALPHA = 1 / 255;
const MAX_ALPHA = 0.999;

/**
 * Returns the optical depth of a scene: the sum of `-ln(1 - alpha)` of all splats at the center of each voxel. Covariances
 * are widened by the variance of a voxel, edge² / 12, so that thin walls do not fall between voxel centers.
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
  const grid = emptyGrid(centers, options.voxel ?? 0.05);
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

function emptyGrid(centers: Float32Array, wanted: number): ExtinctionGrid {
  const count = centers.length / 3;
  const sorted = [0, 1, 2].map((axis) => Float32Array.from({ length: count }, (_, i) => centers[3 * i + axis]).sort());
  const rangesAt = (outliers: number): number[][] =>
    sorted.map((each) => [
      each[Math.floor(outliers * count)],
      each[Math.min(count - 1, Math.floor((1 - outliers) * count))],
    ]);
  const sizeAt = (ranges: readonly number[][], voxel: number): number[] =>
    ranges.map(([low, high]) => Math.ceil((high - low) / voxel) + 2 * MARGIN);
  const isTooLarge = (ranges: readonly number[][], voxel: number): boolean =>
    sizeAt(ranges, voxel).reduce((product, length) => product * length) > MAX_VOXELS;
  let voxel = wanted;
  let ranges = rangesAt(OUTLIERS[0]);
  // Distant splats, such as a background, are left out before voxels become larger.
  for (const outliers of OUTLIERS) if (isTooLarge(ranges, voxel)) ranges = rangesAt(outliers);
  while (isTooLarge(ranges, voxel)) voxel *= 1.25;
  const [nx, ny, nz] = sizeAt(ranges, voxel);
  const [x, y, z] = ranges.map(([low]) => low - MARGIN * voxel);
  return { values: new Float32Array(nx * ny * nz), corner: [x, y, z], size: [nx, ny, nz], voxel };
}

/**
 * Adds the optical depth of splat `i` to the grid.
 * @param k Index of the splat's center in `centers`.
 * @param share Number of splats that the splat represents.
 * @returns The number of voxels that the splat covers.
 */
function addSplat(
  { values, corner, size, voxel }: ExtinctionGrid,
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
  const [xx, xy, xz, yy, yz, zz] = covarianceOf(cloud, i, frame, metersPerUnit, (voxel * voxel) / 12);
  const [a, d, f] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
  const determinant = xx * a + xy * d + xz * f;
  if (!(determinant > 0)) return 0;
  const inverse = [a, d, f, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy].map((v) => v / determinant);
  const reach = Math.sqrt(2 * Math.log(alpha / MIN_ALPHA));
  // A splat that is thicker than a voxel in all directions has only a part of its optical depth in each voxel.
  const { scales } = cloud;
  const thinnest = metersPerUnit * Math.min(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
  const part = share * Math.min(1, voxel / (Math.sqrt(2 * Math.PI) * thinnest));
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
        const value = alpha * Math.exp(-0.5 * (rest + dx * (slope + inverse[0] * dx)));
        if (value > MIN_ALPHA) values[at] -= part * Math.log(1 - value);
      }
    }
  }
  return Math.max(0, x1 - x0 + 1) * Math.max(0, y1 - y0 + 1) * Math.max(0, z1 - z0 + 1);
}

/** Returns the covariance of splat `i` in m² with y up, plus `widened` on its diagonal: xx, xy, xz, yy, yz, zz. */
function covarianceOf(
  { rotations, scales }: GaussianCloud,
  i: number,
  frame: UpFrame,
  metersPerUnit: number,
  widened: number,
): [number, number, number, number, number, number] {
  const [w, x, y, z] = [rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]];
  const columns = [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
  const sums: [number, number, number, number, number, number] = [widened, 0, 0, widened, 0, widened];
  for (let axis = 0; axis < 3; axis++) {
    const scale = metersPerUnit * scales[3 * i + axis];
    const column = columns[axis];
    const [a, b, c] = frame.map((row) => scale * (row[0] * column[0] + row[1] * column[1] + row[2] * column[2]));
    sums[0] += a * a;
    sums[1] += a * b;
    sums[2] += a * c;
    sums[3] += b * b;
    sums[4] += b * c;
    sums[5] += c * c;
  }
  return sums;
}
