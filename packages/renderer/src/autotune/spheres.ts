/** Scenes of spheres for the self-test and for timing, which are cheap to create, pack and project. */
import { lookAt, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { boundChunks } from '../pack/chunks.js';
import { packKept, type PackedGaussians } from '../pack/pack.js';
import { GEOMETRY_WORDS, type ShPrecision } from '../pack/words.js';

/** Returns a camera at an oblique angle, so that the self-test detects a transposed matrix. */
export function probeCamera(width: number, height: number): Camera {
  const worldToCamera = lookAt([1.2, -0.8, -2.6], [0.1, 0.05, 0], [0.1, -1, 0.2]);
  const focal = 1.1 * width;
  return { width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, worldToCamera, near: 0.2, far: 100 };
}

/**
 * Returns spheres of pseudorandom position, size, opacity and view-dependent color, which are equal on every machine.
 * @param size Factor of the radii, which are 0.02 to 0.12 times it, in world units.
 * @param side Side of the cube that contains the centers, in world units.
 * @param shapes Number of spheres after which sizes, opacities and colors repeat; must divide `count`.
 */
export function sphereCloud(count: number, size: number, side = 1.6, shapes = count): GaussianCloud {
  let state = 1;
  const random = (): number => (state = (state * 48271) % 0x7fffffff) / 0x7fffffff;
  const fill = (length: number, value: (i: number) => number): Float32Array => {
    const numbers = new Float32Array(length);
    for (let i = 0; i < length; i++) numbers[i] = value(i);
    return numbers;
  };
  const fillShapes = (length: number, value: (i: number) => number): Float32Array =>
    repeated(fill(length * shapes, value), count / shapes);
  const radii = fill(shapes, () => size * (0.02 + 0.1 * random()));
  return {
    count,
    shDegree: 1,
    antialiased: false,
    origin: [0, 0, 0],
    droppedCount: 0,
    positions: fill(3 * count, () => side * (random() - 0.5)),
    scales: fillShapes(3, (i) => radii[Math.floor(i / 3)]),
    rotations: fillShapes(4, (i) => (i % 4 === 0 ? 1 : 0)),
    opacities: fillShapes(1, () => 0.2 + 0.75 * random()),
    sh: fillShapes(12, (i) => (i % 12 < 3 ? 2.4 : 0.3) * (random() - 0.5)),
  };
}

/**
 * Packs valid spheres as `packGaussians` does, without its checks of untrusted clouds.
 * @param order Indices of the splats in packed order. Default: the order of the cloud; `packGaussians` uses
 * `mortonOrder`.
 */
export function packSpheres(
  cloud: GaussianCloud,
  shPrecision: ShPrecision,
  order: Uint32Array = firstOf(cloud.count),
): PackedGaussians {
  const { count, shDegree, antialiased, filterVariance, origin, droppedCount } = cloud;
  return {
    count,
    shDegree,
    shPrecision,
    antialiased,
    filterVariance,
    origin,
    droppedCount,
    ...packKept(cloud, order, shPrecision),
  };
}

/**
 * Packs spheres whose sizes, opacities and colors repeat after `shapes` spheres. Only the first `shapes` are converted,
 * because JavaScript that the browser has not optimized takes 10 to 20 times as long.
 */
export function packRepeatedSpheres(cloud: GaussianCloud, shapes: number): PackedGaussians {
  const { count, positions } = cloud;
  const packed = packSpheres(cloud, 'float16', firstOf(shapes));
  const geometry = repeated(packed.geometry, count / shapes);
  const floats = new Float32Array(geometry.buffer);
  for (let i = 0, at = 0; i < positions.length; i += 3, at += GEOMETRY_WORDS) {
    floats[at] = positions[i];
    floats[at + 1] = positions[i + 1];
    floats[at + 2] = positions[i + 2];
  }
  const chunks = boundChunks(cloud, firstOf(count));
  return { ...packed, geometry, sh: repeated(packed.sh, count / shapes), chunks };
}

/** Returns copies of packed splats at the same positions. The number of splats must be a multiple of 256. */
export function copiesOf({ geometry, sh, chunks, ...facts }: PackedGaussians, copies: number): PackedGaussians {
  return {
    ...facts,
    count: copies * facts.count,
    geometry: repeated(geometry, copies),
    sh: repeated(sh, copies),
    chunks: repeated(chunks, copies),
  };
}

const firstOf = (count: number): Uint32Array => new Uint32Array(count).map((_, i) => i);

function repeated<T extends Uint32Array | Float32Array>(part: T, copies: number): T {
  const all = new (part.constructor as new (length: number) => T)(copies * part.length);
  for (let k = 0; k < copies; k++) all.set(part, k * part.length);
  return all;
}
