/** Finds the first view of a scene whose surroundings hide it from outside, such as a captured room. */
import type { Ball, Bounds } from '../bounds.js';
import type { GaussianCloud } from '../gaussian-cloud.js';
import { matrixOfQuaternion } from '../linear.js';
import type { Vector3 } from '../vector.js';
import { toScene, toViewer, viewerFrame } from './viewer-frame.js';

/** View from within a scene: {@link Ball.center} is the target of the camera, {@link Ball.radius} its distance. */
export interface InnerView extends Ball {
  /** Point in the direction of the view from the center, at the same height. */
  readonly toward: Vector3;
}

/** Some splats of a scene, in world units. */
export interface SplatSample {
  readonly count: number;
  /** [N, 3], relative to {@link origin}. */
  readonly positions: Float32Array;
  /** [N, 3, 3] columns of a matrix M with the covariance M Mᵀ, such as its axes. */
  readonly axes: Float32Array;
  /** [N], 0..1. */
  readonly opacities: Float32Array;
  readonly origin: Vector3;
}

/** Minimum number of splats of a scene that has inner views; maximum number of splats that represent a scene. */
const [MIN_SPLATS, MAX_SPLATS] = [2048, 32_768];
/** Number of voxels along each edge of the grid of optical depths, and half of its length in radii of the bounds. */
const [SIZE, REACH] = [64, 1.15];
/** Maximum number of points that represent a splat in the grid. */
const MAX_POINTS = 32;
/** Minimum opacity of the splats whose visibility is compared, and maximum number of these. */
const [OPAQUE, MAX_COMPARED] = [0.1, 768];
/** Optical depth around a point in free space, of a surface, and after which a ray shows nothing. */
const [FREE, SURFACE, HIDDEN] = [0.3, 1, 4];
/** Distance in voxels before a splat that its own surface may fill without hiding it. */
const OWN_SURFACE = 1.8;
/** Number of rays from a point, and minimum fraction of them that hit surfaces, so that these enclose the point. */
const [RAYS, ENCLOSED] = [40, 0.5];
/** Number of points whose views are compared, evenly chosen from this multiple of the best enclosed ones. */
const [PLACES, CHOICE] = [32, 4];
/** Sectors of the horizon around a point, and their number in a view. */
const [SECTORS, VIEW_SECTORS] = [36, 6];
/** Tangent of the half vertical field of view, 45°, and minimum distance in voxels of splats that are shown sharply. */
const [TANGENT, MIN_DISTANCE] = [0.414, 2];
/** Polar angle and distance in radii of the subject of the view from outside. */
const [OUTER_PHI, OUTER_DISTANCE] = [(75 * Math.PI) / 180, 1 / Math.sin(Math.PI / 8)];
/** Fraction of the distance to the nearest surface that the camera may use to orbit. */
const ORBIT = 0.7;
/**
 * Minimum ratio of the splats in a view from within to those that are visible from outside. The view from within is
 * nearer, so that it shows fewer splats. The ratio is 0.5 to 3 in six captured rooms, gardens and tables with walls
 * behind them, and at most 0.11 in nine captured objects.
 */
const PREFERRED = 0.25;
/** Angle between successive points of a spiral that covers a disc or a sphere evenly, radians. */
const GOLDEN_ANGLE = 2.399963;

/** Points of a spiral on the unit sphere, from pole to pole. */
const spiral = (count: number): Vector3[] =>
  Array.from({ length: count }, (_, k) => {
    const y = 1 - (2 * k + 1) / count;
    const r = Math.sqrt(1 - y * y);
    return [r * Math.cos(GOLDEN_ANGLE * k), y, r * Math.sin(GOLDEN_ANGLE * k)];
  });

const SPHERE = spiral(RAYS);
const CENTER: Vector3 = [0, 0, 0];
/** Points of a three-dimensional normal distribution, approximately. */
const NORMAL = spiral(MAX_POINTS).map((_, k, all): Vector3 => {
  const [x, y, z] = all[(13 * k) % MAX_POINTS];
  const r = 1.25 * Math.sqrt(-2 * Math.log(1 - (((5 * k) % MAX_POINTS) + 0.5) / MAX_POINTS));
  return [r * x, r * y, r * z];
});

/** Returns evenly spaced splats of a cloud, with their size in the scene if they are those of a preview. */
function sampleOf(cloud: GaussianCloud): SplatSample {
  const { positions, scales, rotations, opacities, origin } = cloud;
  const factor = 1 / Math.sqrt(cloud.hints?.represented ?? 1);
  const step = Math.ceil(cloud.count / MAX_SPLATS);
  const count = Math.floor(cloud.count / step);
  const sample = { positions: new Float32Array(3 * count), axes: new Float32Array(9 * count) };
  for (let k = 0; k < count; k++) {
    const i = k * step;
    const [w, x, y, z] = rotations.subarray(4 * i, 4 * i + 4);
    const matrix = matrixOfQuaternion(w, x, y, z);
    for (let axis = 0; axis < 3; axis++) {
      sample.positions[3 * k + axis] = positions[3 * i + axis];
      for (let row = 0; row < 3; row++)
        sample.axes[9 * k + 3 * axis + row] = matrix[3 * row + axis] * factor * scales[3 * i + axis];
    }
  }
  return { ...sample, count, origin, opacities: Float32Array.from({ length: count }, (_, k) => opacities[k * step]) };
}

/** Returns {@link innerViewFrom} for a cloud, which may be a sample of `total` splats. */
export function innerViewOf(
  cloud: GaussianCloud,
  bounds: Bounds,
  total = cloud.count * (cloud.hints?.represented ?? 1),
): InnerView | undefined {
  return total < MIN_SPLATS ? undefined : innerViewFrom(sampleOf(cloud), bounds, total, cloud.hints?.up);
}

/**
 * Returns the view from within a scene that shows the most splats; undefined if the view from outside shows far more.
 * @param total Number of splats that the sample represents.
 * @param up Unit vector in the coordinates of the cloud. Default: -y.
 */
export function innerViewFrom(
  sample: SplatSample,
  bounds: Bounds,
  total: number,
  up: Vector3 = [0, -1, 0],
): InnerView | undefined {
  if (total < MIN_SPLATS) return undefined;
  const frame = viewerFrame(up);
  const voxel = (2 * REACH * bounds.radius) / SIZE;
  const middle = toViewer(frame, bounds.center);
  const inGrid = (p: Vector3): Vector3 =>
    toViewer(frame, p).map((v, axis) => (v - middle[axis]) / voxel + SIZE / 2) as unknown as Vector3;
  const inScene = (p: Vector3): Vector3 =>
    toScene(frame, [0, 1, 2].map((axis) => (p[axis] - SIZE / 2) * voxel + middle[axis]) as unknown as Vector3);
  const grid = new DepthGrid();
  const corner = inGrid(sample.origin);
  const toGrid = frame.flatMap((row, axis) => [...row.map((v) => v / voxel), corner[axis]]);
  const compared = grid.fill(sample, total / sample.count, toGrid);
  const subject = bounds.subject ?? bounds;
  const [x, y, z] = inGrid(subject.center);
  const distance = (OUTER_DISTANCE * subject.radius) / voxel;
  const eye: Vector3 = [x, y + distance * Math.cos(OUTER_PHI), z + distance * Math.sin(OUTER_PHI)];
  const outside = compared.reduce((sum, to) => sum + grid.visibility(eye, to), 0);
  const best = bestView(grid, compared);
  if (best === undefined || best.shown < PREFERRED * outside) return undefined;
  const { at, free, azimuth } = best;
  return {
    center: inScene(at),
    radius: ORBIT * free * voxel,
    toward: inScene([at[0] + free * Math.cos(azimuth), at[1], at[2] + free * Math.sin(azimuth)]),
  };
}

/** A point in free space, in voxels. */
interface Place {
  readonly at: Vector3;
  /** Distance to the nearest surface. */
  readonly free: number;
  /** Fraction of the rays from the point that hit a surface. */
  readonly enclosed: number;
}

/** Optical depths of the voxels of a cube. Coordinates are in voxels, with y up. */
class DepthGrid {
  readonly #depths = new Float32Array(SIZE ** 3);

  /**
   * Adds the splats of a sample, each of them represents a number.
   * @param toGrid [3, 4] Affine transform from the coordinates of the sample to voxels.
   * @returns the centers of some visible splats
   */
  fill({ count, positions, axes, opacities }: SplatSample, represented: number, toGrid: readonly number[]): Vector3[] {
    const visible: Vector3[] = [];
    const columns = new Float64Array(9);
    for (let i = 0; i < count; i++) {
      const [px, py, pz] = [positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]];
      const x = toGrid[0] * px + toGrid[1] * py + toGrid[2] * pz + toGrid[3];
      const y = toGrid[4] * px + toGrid[5] * py + toGrid[6] * pz + toGrid[7];
      const z = toGrid[8] * px + toGrid[9] * py + toGrid[10] * pz + toGrid[11];
      let squares = 0;
      for (let k = 0; k < 9; k++) {
        const [row, at] = [4 * (k % 3), 9 * i + k - (k % 3)];
        columns[k] = toGrid[row] * axes[at] + toGrid[row + 1] * axes[at + 1] + toGrid[row + 2] * axes[at + 2];
        squares += columns[k] ** 2;
      }
      const opacity = Math.min(0.99, opacities[i]);
      if (opacity >= OPAQUE && indexOf(x, y, z) >= 0) visible.push([x, y, z]);
      this.#add(x, y, z, columns, Math.sqrt(squares), -Math.log(1 - opacity) * represented);
    }
    const step = Math.ceil(visible.length / MAX_COMPARED);
    return visible.filter((_, k) => k % step === 0);
  }

  /** Adds an ellipsoid with an optical depth at its center. `m` has three vectors, whose squares have the sum length². */
  #add(x: number, y: number, z: number, m: Float64Array, length: number, depth: number): void {
    // The product of the two longest axes of the ellipsoid, which is nearly flat: the norm of the minors of order 2.
    let minors = 0;
    for (let k = 0; k < 9; k += 3)
      for (let axis = 0, n = (k + 3) % 9; axis < 3; axis++) {
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        minors += (m[k + u] * m[n + v] - m[k + v] * m[n + u]) ** 2;
      }
    const area = Math.sqrt(minors);
    const points = length < 0.5 ? 1 : Math.min(MAX_POINTS, Math.ceil(4 * length + 8 * area));
    const share = (depth * 2 * Math.PI * area) / points;
    for (let k = 0; k < points; k++) {
      const [s, t, u] = points === 1 ? CENTER : NORMAL[k];
      const dx = s * m[0] + t * m[3] + u * m[6];
      const dy = s * m[1] + t * m[4] + u * m[7];
      const at = indexOf(x + dx, y + dy, z + s * m[2] + t * m[5] + u * m[8]);
      if (at >= 0) this.#depths[at] += share;
    }
  }

  /** Returns the distance along a ray to a surface; `SIZE` if there is none. */
  #wayTo([x, y, z]: Vector3, [dx, dy, dz]: Vector3): number {
    for (let way = 0.5, depth = 0; way < SIZE; way++) {
      const at = indexOf(x + way * dx, y + way * dy, z + way * dz);
      if (at < 0) return SIZE;
      if ((depth += this.#depths[at]) > SURFACE) return way;
    }
    return SIZE;
  }

  /** Returns the transmittance from a point to a splat, 0..1. */
  visibility([x, y, z]: Vector3, to: Vector3): number {
    const [dx, dy, dz] = [to[0] - x, to[1] - y, to[2] - z];
    const length = Math.sqrt(dx * dx + dy * dy + dz * dz);
    let depth = 0;
    // From the splat, which is in the grid, toward the point, which may be far away.
    for (let way = length - OWN_SURFACE; way > 0 && depth < HIDDEN; way--) {
      const at = indexOf(x + (way / length) * dx, y + (way / length) * dy, z + (way / length) * dz);
      if (at < 0) break;
      depth += this.#depths[at];
    }
    return Math.exp(-depth);
  }

  /** Returns the enclosed points in free space, the most enclosed and free ones first. */
  places(): Place[] {
    const places: Place[] = [];
    for (let x = 2.5; x < SIZE - 2; x += 4)
      for (let y = 2.5; y < SIZE - 2; y += 2)
        for (let z = 2.5; z < SIZE - 2; z += 4) {
          const at: Vector3 = [x, y, z];
          if (!this.#isFree(at)) continue;
          let [open, free] = [0, SIZE];
          for (let k = 0; k < RAYS && open <= (1 - ENCLOSED) * RAYS; k++) {
            const way = this.#wayTo(at, SPHERE[(7 * k) % RAYS]);
            if (way === SIZE) open++;
            else free = Math.min(free, way);
          }
          const enclosed = 1 - open / RAYS;
          if (enclosed >= ENCLOSED) places.push({ at, free, enclosed });
        }
    return places.sort((a, b) => b.free * b.enclosed - a.free * a.enclosed);
  }

  /** Whether the voxels around a point are nearly empty. */
  #isFree([x, y, z]: Vector3): boolean {
    let depth = 0;
    for (let dz = -1; dz <= 1; dz++)
      for (let dy = -1; dy <= 1; dy++)
        for (let dx = -1; dx <= 1; dx++) depth += this.#depths[indexOf(x + dx, y + dy, z + dz)];
    return depth <= FREE;
  }
}

/** Returns the index of the voxel that contains a point; -1 outside of the grid. */
function indexOf(x: number, y: number, z: number): number {
  if (!(x >= 0 && y >= 0 && z >= 0 && x < SIZE && y < SIZE && z < SIZE)) return -1;
  return Math.floor(x) + SIZE * (Math.floor(y) + SIZE * Math.floor(z));
}

/**
 * Returns the level view from an enclosed point that shows the most splats, and its azimuth from +x to +z in radians. The
 * square of the enclosed fraction prefers the room to the other side of its window.
 */
function bestView(
  grid: DepthGrid,
  splats: readonly Vector3[],
): (Place & { shown: number; azimuth: number }) | undefined {
  let best: (Place & { shown: number; azimuth: number }) | undefined;
  const places = grid
    .places()
    .slice(0, CHOICE * PLACES)
    .filter((_, k) => k % CHOICE === 0);
  for (const place of places) {
    const sectors = new Float64Array(SECTORS);
    for (const to of splats) {
      const [dx, dy, dz] = [to[0] - place.at[0], to[1] - place.at[1], to[2] - place.at[2]];
      const distance = Math.sqrt(dx * dx + dz * dz);
      if (distance < MIN_DISTANCE || Math.abs(dy) > TANGENT * distance) continue;
      const turn = Math.atan2(dz, dx) / (2 * Math.PI) + 1;
      sectors[Math.floor((turn % 1) * SECTORS)] += grid.visibility(place.at, to);
    }
    for (let k = 0; k < SECTORS; k++) {
      let shown = 0;
      for (let j = 0; j < VIEW_SECTORS; j++) shown += sectors[(k + j) % SECTORS];
      const azimuth = ((k + VIEW_SECTORS / 2) / SECTORS) * 2 * Math.PI;
      const isBetter = best === undefined || shown * place.enclosed ** 2 > best.shown * best.enclosed ** 2;
      if (isBetter) best = { ...place, shown, azimuth };
    }
  }
  return best;
}
