import { cameraFromProjection, multiply, type Camera } from '@gaussian-splat/core';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { EYE, headset } from './headset.js';

/** The camera of an eye in the scene's frame, by the rules of the start: the camera's place and heading, the floor 1.6 m below. */
export function cameraOf(element: GaussianSplatElement, eye: 'left' | 'right', size = EYE): Camera {
  const { theta, phi, radius } = element.getCameraOrbit();
  const target = element.getCameraTarget();
  const at = [
    target.x + radius * Math.sin(phi) * Math.sin(theta),
    target.y + radius * Math.cos(phi) - 1.6,
    target.z + radius * Math.sin(phi) * Math.cos(theta),
  ];
  const [sin, cos] = [Math.sin(theta), Math.cos(theta)];
  const turn = [cos, 0, -sin, 0, 0, 1, 0, 0, sin, 0, cos, 0, 0, 0, 0, 1];
  const move = [1, 0, 0, -at[0], 0, 1, 0, -at[1], 0, 0, 1, -at[2], 0, 0, 0, 1];
  const upright = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];
  const { position, ipd } = headset().device;
  const side = (eye === 'left' ? -1 : 1) * (ipd / 2);
  const view = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -side, -position.y, 0, 1];
  const room = cameraFromProjection(view, headset().projection(eye), { ...size, clipDepth: '-1..1' });
  return { ...room, worldToCamera: multiply(multiply(multiply(room.worldToCamera, turn), move), upright) };
}
