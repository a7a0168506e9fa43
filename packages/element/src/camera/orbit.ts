/** Orbit geometry. Viewer space: the scene's frame turned so that y is up; right-handed, in world units (metres). */
import { DEFAULT_FAR, dot, type Bounds, type Camera, type Vector3 } from '@gaussian-splat/core';

/** All that moves: the orbit, its target in viewer space, and the vertical field of view. Radians and world units. */
export interface CameraPose {
  readonly theta: number;
  readonly phi: number;
  readonly radius: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly fieldOfView: number;
}

/** Rows of the rotation that takes the scene's frame to viewer space. */
export type ViewerFrame = readonly [Vector3, Vector3, Vector3];

/**
 * The rotation that brings a direction of length 1 to +y. The horizontal axes stay where they were as far as possible; for -y, the frame of the
 * trainers, this is diag(1, -1, -1), and for what is near it a frame near that: it is the shortest turn to +y or to -y, whichever is nearer.
 */
export function viewerFrame([x, y, z]: Vector3): ViewerFrame {
  const side = y < 0 ? -1 : 1;
  const share = 1 / (1 + side * y);
  const both = share * x * z;
  return [
    [1 - share * x * x, 0 - side * x, 0 - both],
    [x, y, z],
    [0 - side * both, 0 - z, side * (1 - share * z * z)],
  ];
}

/** A direction or point of the scene's frame, in viewer space. */
export const toViewer = (frame: ViewerFrame, v: Vector3): Vector3 => [
  dot(frame[0], v),
  dot(frame[1], v),
  dot(frame[2], v),
];

/** A direction or point of viewer space, in the scene's frame: the transpose, as the frame is a rotation. */
export const toScene = (frame: ViewerFrame, v: Vector3): Vector3 => [
  frame[0][0] * v[0] + frame[1][0] * v[1] + frame[2][0] * v[2],
  frame[0][1] * v[0] + frame[1][1] * v[1] + frame[2][1] * v[2],
  frame[0][2] * v[0] + frame[1][2] * v[1] + frame[2][2] * v[2],
];

/** Axes of the camera in viewer space, written out so that looking straight down or up is as good as any view. */
export function orbitAxes(theta: number, phi: number): { right: Vector3; up: Vector3; backward: Vector3 } {
  const [sinTheta, cosTheta, sinPhi, cosPhi] = [Math.sin(theta), Math.cos(theta), Math.sin(phi), Math.cos(phi)];
  return {
    right: [cosTheta, 0, -sinTheta],
    up: [-sinTheta * cosPhi, sinPhi, -cosTheta * cosPhi],
    backward: [sinTheta * sinPhi, cosPhi, cosTheta * sinPhi],
  };
}

/** Where the eye of a pose is, in viewer space. */
export function eyeOfPose(pose: CameraPose): Vector3 {
  const { backward } = orbitAxes(pose.theta, pose.phi);
  return [pose.x + pose.radius * backward[0], pose.y + pose.radius * backward[1], pose.z + pose.radius * backward[2]];
}

/**
 * Distance at which a ball of the given radius just fits into the picture: radius / sin(half the smaller angle of view).
 * @param radius world units, above 0.
 * @param fieldOfView vertical, radians.
 * @param aspect width / height, above 0.
 */
export function framingDistance(radius: number, fieldOfView: number, aspect: number): number {
  const vertical = fieldOfView / 2;
  const horizontal = Math.atan(Math.tan(vertical) * aspect);
  return radius / Math.sin(Math.min(vertical, horizontal));
}

/** Near plane in world units: the trainers' 0.2, or less for a scene so small that 0.2 would cut into it. */
export const nearPlane = (bounds: Bounds): number => Math.min(0.2, bounds.radius / 100);

/** The pinhole camera of a pose, in the scene's own frame, for a picture of width x height pixels. */
export function cameraOfPose(
  pose: CameraPose,
  frame: ViewerFrame,
  width: number,
  height: number,
  near: number,
): Camera {
  const { right, up, backward } = orbitAxes(pose.theta, pose.phi);
  const negate = (v: Vector3): Vector3 => [-v[0], -v[1], -v[2]];
  const eyeInScene = toScene(frame, eyeOfPose(pose));
  const row = (axis: Vector3): number[] => {
    const inScene = toScene(frame, axis);
    return [...inScene, -dot(inScene, eyeInScene)];
  };
  const focal = height / (2 * Math.tan(pose.fieldOfView / 2));
  return {
    width,
    height,
    fx: focal,
    fy: focal,
    cx: width / 2,
    cy: height / 2,
    worldToCamera: Float64Array.from([...row(right), ...row(negate(up)), ...row(negate(backward)), 0, 0, 0, 1]),
    near,
    far: DEFAULT_FAR,
  };
}
