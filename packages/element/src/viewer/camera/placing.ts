/** Converts the attributes of a child to matrices. */
import { linearDeterminant, multiply, type Camera, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { ViewerFrame } from './orbit.js';

/** Components of the transform of a child in viewer space. */
export interface Turns {
  readonly position: Vector3;
  /** Angles about the x, y and z axes, radians. */
  readonly rotation: Vector3;
  readonly scale: Vector3;
}

/**
 * Returns the row-major matrix of a scale, a rotation and a translation, in this order. The rotation about z is applied
 * first, then about x, then about y.
 */
export function matrixOf({ position: [px, py, pz], rotation: [x, y, z], scale: [sx, sy, sz] }: Turns): Float64Array {
  const [a, b, c] = [Math.sin(x), Math.sin(y), Math.sin(z)];
  const [u, v, w] = [Math.cos(x), Math.cos(y), Math.cos(z)];
  return Float64Array.of(
    ...[sx * (v * w + b * a * c), sy * (b * a * w - v * c), sz * b * u, px],
    ...[sx * u * c, sy * u * w, -sz * a, py],
    ...[sx * (v * a * c - b * w), sy * (v * a * w + b * c), sz * v * u, pz],
    ...[0, 0, 0, 1],
  );
}

/**
 * Returns a row-major affine matrix from a value of the page: 16 numbers in row-major order, or a DOMMatrix. Undefined
 * for any other value.
 */
export function readMatrix(value: unknown): Matrix4 | undefined {
  // A DOMMatrix is column-major.
  if (value instanceof DOMMatrixReadOnly) return transposed(value.toFloat64Array());
  const numbers = Array.from(Object(value) as ArrayLike<number>, Number);
  const isAffine = numbers.length === 16 && numbers.every(Number.isFinite) && numbers.slice(12).join() === '0,0,0,1';
  return isAffine ? numbers : undefined;
}

/** Converts a 4x4 matrix from row-major to column-major order, or back. */
export const transposed = (m: Matrix4): Float64Array =>
  Float64Array.from({ length: 16 }, (_, k) => m[4 * (k % 4) + (k >> 2)]);

/** Returns the rotation from scene coordinates to viewer space as a row-major 4x4 matrix. */
export const matrixOfFrame = (frame: ViewerFrame): Float64Array =>
  Float64Array.of(...frame.flatMap((row) => [...row, 0]), 0, 0, 0, 1);

/**
 * Returns the transform of a scene to world coordinates, which are those of the element's own scene.
 * @param world Rotation from the world to viewer space.
 * @param placed Transform in viewer space.
 * @param own Rotation from the scene's coordinates to viewer space.
 */
export const sceneToWorld = (world: ViewerFrame, placed: Matrix4, own: ViewerFrame): Float64Array =>
  multiply(multiply(transposed(matrixOfFrame(world)), placed), matrixOfFrame(own));

/** Returns whether a matrix is invertible. A singular one, such as a scale of 0, makes its content invisible. */
export function isSolid(m: Matrix4): boolean {
  return Number.isFinite(1 / linearDeterminant(m));
}

/**
 * Returns a camera in the coordinates and units of a scene, from one in world coordinates.
 * @param toWorld Transform from the scene to the world.
 */
export function cameraInScene(camera: Camera, toWorld: Matrix4): Camera {
  const size = Math.cbrt(Math.abs(linearDeterminant(toWorld)));
  const matrix = multiply(camera.worldToCamera, toWorld).map((value, k) => (k < 12 ? value / size : value));
  return { ...camera, worldToCamera: matrix, near: camera.near / size, far: camera.far / size };
}
