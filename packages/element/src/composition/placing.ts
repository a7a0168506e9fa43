/** From what a child says of its place to matrices. */
import { multiply, type Camera, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { ViewerFrame } from '../camera/orbit.js';

/** What places a child in viewer space. */
export interface Turns {
  readonly position: Vector3;
  /** Radians about x, y and z. */
  readonly rotation: Vector3;
  readonly scale: Vector3;
}

/** Position, rotation and scale as one matrix: the z axis is turned about first, then x, then y. */
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

/** A matrix as a page gives it: 16 numbers, row after row, or a DOMMatrix; undefined for anything else. */
export function readMatrix(value: unknown): Matrix4 | undefined {
  // A DOMMatrix gives its columns one after the other.
  if (value instanceof DOMMatrixReadOnly) return transposed(value.toFloat64Array());
  const numbers = Array.from(Object(value) as ArrayLike<number>, Number);
  const isAffine = numbers.length === 16 && numbers.every(Number.isFinite) && numbers.slice(12).join() === '0,0,0,1';
  return isAffine ? numbers : undefined;
}

/** Rows as columns. */
export const transposed = (m: Matrix4): Float64Array =>
  Float64Array.from({ length: 16 }, (_, k) => m[4 * (k % 4) + (k >> 2)]);

/** The rotation of a frame, from the scene to viewer space, as a matrix. */
export const matrixOfFrame = (frame: ViewerFrame): Float64Array =>
  Float64Array.of(...frame.flatMap((row) => [...row, 0]), 0, 0, 0, 1);

/**
 * Where a scene stands in the world, which is the frame of the element's own scene.
 * @param world rotation from the world to viewer space
 * @param placed in viewer space
 * @param own rotation of the scene, from its own frame to viewer space
 */
export const sceneToWorld = (world: ViewerFrame, placed: Matrix4, own: ViewerFrame): Float64Array =>
  multiply(multiply(transposed(matrixOfFrame(world)), placed), matrixOfFrame(own));

/** False for a matrix that makes space flat, as a scale of 0 does: nothing is seen of what it places. */
export function isSolid(m: Matrix4): boolean {
  return Number.isFinite(1 / determinant(m));
}

function determinant(m: Matrix4): number {
  return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
}

/** A camera of the world as a scene sees it that stands there, in the scene's own units. */
export function cameraInScene(camera: Camera, toWorld: Matrix4): Camera {
  const size = Math.cbrt(Math.abs(determinant(toWorld)));
  const matrix = multiply(camera.worldToCamera, toWorld).map((value, k) => (k < 12 ? value / size : value));
  return { ...camera, worldToCamera: matrix, near: camera.near / size, far: camera.far / size };
}
