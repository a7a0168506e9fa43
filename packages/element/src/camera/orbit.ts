/**
 * Orbit geometry. Viewer space: the scene's coordinates rotated so that y is up; right-handed, in world units (meters).
 */
import { DEFAULT_FAR, dot, type Bounds, type Camera, type Vector3 } from '@gaussian-splat/core';

/** The animated state: the orbit, its target in viewer space, and the vertical field of view. Radians and world units. */
export interface CameraPose {
  readonly theta: number;
  readonly phi: number;
  readonly radius: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly fieldOfView: number;
}

/** Rows of the rotation from scene coordinates to viewer space. */
export type ViewerFrame = readonly [Vector3, Vector3, Vector3];

/**
 * The rotation of a unit vector to +y that changes the horizontal axes as little as possible. For -y, the convention of
 * the trainers, it is diag(1, -1, -1), and for nearby directions a similar one: the shortest rotation to +y or to -y,
 * whichever is nearer.
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

/** Converts a direction or point from scene coordinates to viewer space. */
export const toViewer = (frame: ViewerFrame, v: Vector3): Vector3 => [
  dot(frame[0], v),
  dot(frame[1], v),
  dot(frame[2], v),
];

/**
 * Converts a direction or point from viewer space to scene coordinates: by the transpose, because the matrix is a
 * rotation.
 */
export const toScene = (frame: ViewerFrame, v: Vector3): Vector3 => [
  frame[0][0] * v[0] + frame[1][0] * v[1] + frame[2][0] * v[2],
  frame[0][1] * v[0] + frame[1][1] * v[1] + frame[2][1] * v[2],
  frame[0][2] * v[0] + frame[1][2] * v[1] + frame[2][2] * v[2],
];

/** Axes of the camera in viewer space, in explicit form so that looking straight down or up is not singular. */
export function orbitAxes(theta: number, phi: number): { right: Vector3; up: Vector3; backward: Vector3 } {
  const [sinTheta, cosTheta, sinPhi, cosPhi] = [Math.sin(theta), Math.cos(theta), Math.sin(phi), Math.cos(phi)];
  return {
    right: [cosTheta, 0, -sinTheta],
    up: [-sinTheta * cosPhi, sinPhi, -cosTheta * cosPhi],
    backward: [sinTheta * sinPhi, cosPhi, cosTheta * sinPhi],
  };
}

/** Position of a pose's eye in viewer space. */
export function eyeOfPose(pose: CameraPose): Vector3 {
  const { backward } = orbitAxes(pose.theta, pose.phi);
  return [pose.x + pose.radius * backward[0], pose.y + pose.radius * backward[1], pose.z + pose.radius * backward[2]];
}

/**
 * Framing distance of a sphere of the given radius: radius / sin(half the smaller field of view).
 * @param radius World units, above 0.
 * @param fieldOfView Vertical, radians.
 * @param aspect Width / height, above 0.
 */
export function framingDistance(radius: number, fieldOfView: number, aspect: number): number {
  const vertical = fieldOfView / 2;
  const horizontal = Math.atan(Math.tan(vertical) * aspect);
  return radius / Math.sin(Math.min(vertical, horizontal));
}

/** Near plane in world units: the trainers' 0.2, or less for a scene small enough to be clipped by it. */
export const nearPlane = (bounds: Bounds): number => Math.min(0.2, bounds.radius / 100);

/** The pinhole camera of a pose, in scene coordinates, for a frame of width x height pixels. */
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

/**
 * The same view by parallel rays: as large at the target. The eye goes back until it has all of the scene before it.
 * @param radius distance of the eye to the target
 * @param reach distance from the target within which the scene lies
 */
export function parallelCamera(camera: Camera, radius: number, reach: number): Camera {
  const { fx, fy, worldToCamera } = camera;
  const back = Float64Array.from(worldToCamera);
  back[11] += reach;
  // Rounded up, for what depends on it to stay as it is while the camera moves.
  const far = 2 ** Math.ceil(Math.log2(radius + 2 * reach));
  return { ...camera, fx: fx / radius, fy: fy / radius, worldToCamera: back, far, orthographic: true };
}
