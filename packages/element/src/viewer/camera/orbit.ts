/**
 * Geometry of the orbit. Viewer space is the scene's coordinate system rotated so that y is up: right-handed, in world
 * units (meters).
 */
import { DEFAULT_FAR, dot, type Bounds, type Camera, type Vector3 } from '@gaussian-splat/core';
import { toScene, type ViewerFrame } from '@gaussian-splat/core/views';

export { toScene, toViewer, viewerFrame, type ViewerFrame } from '@gaussian-splat/core/views';

/**
 * Pose of the camera: azimuth `theta` and polar angle `phi` of the orbit, its `radius`, its target x, y, z in viewer
 * space, and the vertical field of view. Radians and world units.
 */
export interface CameraPose {
  readonly theta: number;
  readonly phi: number;
  readonly radius: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly fieldOfView: number;
}

/**
 * Returns the unit axes of the camera in viewer space for angles in radians. The explicit form is not singular for a
 * view straight down or up.
 */
export function orbitAxes(theta: number, phi: number): { right: Vector3; up: Vector3; backward: Vector3 } {
  const [sinTheta, cosTheta, sinPhi, cosPhi] = [Math.sin(theta), Math.cos(theta), Math.sin(phi), Math.cos(phi)];
  return {
    right: [cosTheta, 0, -sinTheta],
    up: [-sinTheta * cosPhi, sinPhi, -cosTheta * cosPhi],
    backward: [sinTheta * sinPhi, cosPhi, cosTheta * sinPhi],
  };
}

/** Returns the position of a pose's eye in viewer space. */
export function eyeOfPose(pose: CameraPose): Vector3 {
  const { backward } = orbitAxes(pose.theta, pose.phi);
  return [pose.x + pose.radius * backward[0], pose.y + pose.radius * backward[1], pose.z + pose.radius * backward[2]];
}

/**
 * Returns the distance that frames a sphere: radius / sin(half the smaller field of view).
 * @param radius World units, above 0.
 * @param fieldOfView Vertical, radians.
 * @param aspect Width / height, above 0.
 */
export function framingDistance(radius: number, fieldOfView: number, aspect: number): number {
  const vertical = fieldOfView / 2;
  const horizontal = Math.atan(Math.tan(vertical) * aspect);
  return radius / Math.sin(Math.min(vertical, horizontal));
}

/**
 * Distance of the near plane, world units: 0.2 as in the trainers, or less for a small scene that this plane would
 * clip.
 */
export const nearPlane = (bounds: Bounds): number => Math.min(0.2, bounds.radius / 100);

/** Returns the pinhole camera of a pose, in scene coordinates, for a frame of width x height pixels. */
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
 * Returns the orthographic camera with the same scale at the target. Its eye is moved back by `reach`, so that the
 * whole scene is in front of it.
 * @param radius Distance of the eye to the target, world units.
 * @param reach Maximum distance of the scene from the target, world units.
 */
export function parallelCamera(camera: Camera, radius: number, reach: number): Camera {
  const { fx, fy, worldToCamera } = camera;
  const back = Float64Array.from(worldToCamera);
  back[11] += reach;
  // The far plane is rounded up to a power of 2, so that it seldom changes while the camera moves.
  const far = 2 ** Math.ceil(Math.log2(radius + 2 * reach));
  return { ...camera, fx: fx / radius, fy: fy / radius, worldToCamera: back, far, orthographic: true };
}
