import { subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import { boxPoints } from './camera/box-points.js';
import { toViewer } from './camera/orbit.js';
import { unproject } from './camera/projection.js';
import { ScenePoint } from './camera/values.js';
import type { CameraController } from './controllers/camera-controller.js';
import type { ViewController } from './controllers/view-controller.js';
import { isGone } from './gpu/device-failures.js';

export interface QueryHost {
  readonly camera: Pick<CameraController, 'viewerFrame'>;
  /** Looks into the last frame. Rejects if it is gone. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  readonly view: Pick<ViewController, 'painter'>;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  readonly drawnFrom: Camera | undefined;
  /** What the frame covers, once it is rendered. */
  readonly surface: HTMLElement | null;
}

/**
 * The visible surface under a point of the page, read back from the GPU beside the frames.
 * @param clientX CSS pixels, as of a MouseEvent.
 * @returns null beside the scene, where it is more transparent than not, or if the frame is gone meanwhile.
 */
export async function positionFromPoint(host: QueryHost, clientX: number, clientY: number): Promise<ScenePoint | null> {
  const { camera, view, drawnFrom: drawn, surface } = host;
  const { painter } = view;
  if (drawn === undefined || painter === null || surface === null) return null;
  const share = boxPoints(surface)(clientX, clientY);
  const [x, y] = [share.x * drawn.width, share.y * drawn.height];
  if (!(x >= 0 && y >= 0 && x < drawn.width && y < drawn.height)) return null;
  try {
    const [answer] = await host.probe([{ x, y }]);
    if (!answer || answer.depth === null) return null;
    const { near, depth, far } = answer;
    const at = (z: number): Vector3 => unproject(drawn, { x, y, depth: z });
    const uncertainty = far === null ? Infinity : distance(at(near ?? depth), at(far)) / 2;
    return new ScenePoint(...toViewer(camera.viewerFrame, at(depth)), uncertainty);
  } catch (error) {
    // A device that was lost meanwhile has nothing more to say, and its loss is told elsewhere.
    if (await isGone(painter)) return null;
    throw error;
  }
}

const distance = (a: Vector3, b: Vector3): number => Math.hypot(...subtract(a, b));
