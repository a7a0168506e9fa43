/**
 * Fixed camera paths, so that every machine and every renderer draws the same frames. A path is a function of the
 * frame's index: time advances by 1/60 s a frame, independent of the frame rate.
 */
import { lookAt } from '@gaussian-splat/core';
import { LONE_RADIUS } from './placement.js';

const SECONDS = 1 / 60;
const UP = [0, -1, 0];
const NEAR = 0.2;
const FAR = 1e10;
/** Focal length in image heights: that of 1200 px at 1080 lines, a vertical field of view of 48.5 degrees. */
const FOCAL = 1200 / 1080;
const ZOOM = 64;
/** Frames that the snap stays on each side. */
const SNAP_FRAMES = 10;
/** Half a degree: what turns among the copies in a frame. */
const AMONG_STEP = Math.PI / 360;

const yawed = (eye, angle) => lookAt(eye, [eye[0] + Math.sin(angle), eye[1] + 0.2, eye[2] + Math.cos(angle)], UP);

/** Around the origin at a distance r, a little above the ground. */
const around = (angle, r) => lookAt([r * Math.sin(angle), -0.45 * r, -r * Math.cos(angle)], [0, 0, 0], UP);

/**
 * World-to-camera matrix by frame, around a scene of radius r on the ground plane (y points down); `lone` is the radius that one copy
 * would have. `progress` runs from 0 to 1 over the frames of a visit.
 */
const PATHS = {
  /** Around the scene, 28.6 degrees a second. */
  orbit: ({ seconds, r }) => around(0.5 * seconds, r),
  /** Around the copy in the middle as if it stood alone, so among the others, half a degree a frame. */
  among: ({ frame, lone }) => around(AMONG_STEP * frame, lone),
  /** Into the scene. */
  dolly: ({ seconds, r }) => lookAt([0, -0.3 * r, -r + 0.4 * seconds], [0, 0, 0.4 * seconds], UP),
  /** In its middle, turning 60 degrees a second. */
  yaw: ({ seconds, r }) => yawed([0, -0.3 * r, 0], (Math.PI / 3) * seconds),
  /** In its middle, turning by 180 degrees at once: a depth order and its opposite. */
  snap: ({ frame, r }) => yawed([0, -0.3 * r, 0], Math.floor(frame / SNAP_FRAMES) % 2 ? Math.PI : 0),
  /** From the orbit's distance to 64 times as far, evenly on a logarithmic scale. */
  zoom: ({ progress, r }) => lookAt([0, -0.45 * r * ZOOM ** progress, -r * ZOOM ** progress], [0, 0, 0], UP),
  /** Sideways without turning: the depth order stays. */
  strafe: ({ progress, r }) => {
    const x = (progress - 0.5) * r;
    return lookAt([x, -0.45 * r, -r], [x, 0, 0], UP);
  },
};

export const PATH_NAMES = Object.keys(PATHS);

/** The cameras of `frames` frames along a path, in pixels and OpenCV axes. `radius` is that of the scene times `distance`. */
export function camerasAlong({ path, width, height, frames, radius, distance = 1 }) {
  if (!(path in PATHS)) throw new RangeError(`path: expected ${PATH_NAMES.join(', ')}, found "${path}"`);
  return Array.from({ length: frames }, (_, frame) => ({
    width,
    height,
    fx: FOCAL * height,
    fy: FOCAL * height,
    cx: width / 2,
    cy: height / 2,
    near: NEAR,
    far: FAR,
    worldToCamera: PATHS[path]({
      frame,
      seconds: frame * SECONDS,
      progress: frame / Math.max(1, frames - 1),
      r: radius,
      lone: distance * LONE_RADIUS,
    }),
  }));
}
