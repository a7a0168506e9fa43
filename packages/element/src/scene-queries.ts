import { toViewer } from './camera/orbit.js';
import type { SceneBounds } from './camera/settings.js';
import { ScenePoint } from './camera/values.js';
import type { CameraController } from './controllers/camera-controller.js';

/** A box in viewer space, its sides along the axes. */
export interface SceneBox {
  readonly min: ScenePoint;
  readonly max: ScenePoint;
}

/** Box around nearly all of the visible splats; null if there are none. */
export function boxOf(shown: {
  readonly camera: Pick<CameraController, 'viewerFrame'>;
  readonly bounds: SceneBounds | null;
}): SceneBox | null {
  const { camera, bounds } = shown;
  if (bounds === null) return null;
  const [a, b] = [toViewer(camera.viewerFrame, bounds.min), toViewer(camera.viewerFrame, bounds.max)];
  const corner = (pick: (p: number, q: number) => number): ScenePoint =>
    new ScenePoint(pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2]));
  return { min: corner(Math.min), max: corner(Math.max) };
}
