import { GaussianSplatError, type GaussianCloud, type Vector3 } from '@gaussian-splat/core';

/** Rows of the rotation from the coordinates of the cloud to those with y up. */
export type UpFrame = readonly [Vector3, Vector3, Vector3];

/** Cubic voxels: a frame with y up, lengths in meters. */
export interface VoxelGrid {
  /** Corner of the first voxel, meters. */
  readonly corner: Vector3;
  /** Number of voxels along x, y and z. */
  readonly size: readonly [nx: number, ny: number, nz: number];
  /** Edge of a voxel, meters. */
  readonly voxel: number;
}

/** Optical depth of a scene in voxels. */
export interface ExtinctionGrid extends VoxelGrid {
  /** [nz, ny, nx] sums of `-ln(1 - alpha)`, x innermost. */
  readonly values: Float32Array;
}

export interface GridOptions {
  /** Meters in one unit of the scene; default 1. */
  readonly metersPerUnit?: number;
  readonly frame: UpFrame;
  /** Edge of a voxel, meters; default 0.05. Scenes that would need more than {@link MAX_VOXELS} get larger voxels. */
  readonly voxel?: number;
}

/** Largest grid: 64 MB of float32. */
export const MAX_VOXELS = 2 ** 24;
/** Maximum number of splats for the grid; larger scenes are sampled evenly, and each sample represents its neighbors. */
const MAX_SPLATS = 500_000;
/** Fraction of the splats that may lie outside the grid on each side, so that distant outliers do not enlarge it. */
const OUTLIERS = 0.003;
/** Empty voxels around the scene. */
const MARGIN = 4;
const MIN_ALPHA = 1 / 255;
const MAX_ALPHA = 0.999;

/**
 * Adds the optical depth `-ln(1 - alpha)` of every splat to the voxels in its reach. The covariance is widened by the variance of a voxel, edge² / 12, so
 * that thin walls do not fall between voxel centers.
 * @throws GaussianSplatError `argument/value` for lengths that are not positive and finite.
 */
export function extinctionOf(cloud: GaussianCloud, options: GridOptions): ExtinctionGrid {
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
    addSplat(grid, cloud, i, k, centers, frame, metersPerUnit, step);
  return grid;
}

/** [N, 3] centers of every `step`th splat, meters, y up. */
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
  const ranges = [0, 1, 2].map((axis) => {
    const sorted = Float32Array.from({ length: count }, (_, i) => centers[3 * i + axis]).sort();
    return [sorted[Math.floor(OUTLIERS * count)], sorted[Math.min(count - 1, Math.floor((1 - OUTLIERS) * count))]];
  });
  const sizeAt = (voxel: number): number[] => ranges.map(([low, high]) => Math.ceil((high - low) / voxel) + 2 * MARGIN);
  let voxel = wanted;
  while (sizeAt(voxel).reduce((product, length) => product * length) > MAX_VOXELS) voxel *= 1.25;
  const [nx, ny, nz] = sizeAt(voxel);
  const [x, y, z] = ranges.map(([low]) => low - MARGIN * voxel);
  return { values: new Float32Array(nx * ny * nz), corner: [x, y, z], size: [nx, ny, nz], voxel };
}

/** Adds splat `i`, whose center is entry `k`; `share` is the number of splats that it represents. */
function addSplat(
  { values, corner, size, voxel }: ExtinctionGrid,
  cloud: GaussianCloud,
  i: number,
  k: number,
  centers: Float32Array,
  frame: UpFrame,
  metersPerUnit: number,
  share: number,
): void {
  const alpha = Math.min(MAX_ALPHA, cloud.opacities[i]);
  if (!(alpha >= MIN_ALPHA)) return;
  const [xx, xy, xz, yy, yz, zz] = covarianceOf(cloud, i, frame, metersPerUnit, (voxel * voxel) / 12);
  const [a, d, f] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
  const determinant = xx * a + xy * d + xz * f;
  if (!(determinant > 0)) return;
  const inverse = [a, d, f, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy].map((v) => v / determinant);
  const reach = Math.sqrt(2 * Math.log(alpha / MIN_ALPHA));
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
        if (value > MIN_ALPHA) values[at] -= share * Math.log(1 - value);
      }
    }
  }
}

/** Covariance of splat `i`, meters², y up, with `widened` added to its diagonal: xx, xy, xz, yy, yz, zz. */
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
