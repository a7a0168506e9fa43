import type { Camera } from '@gaussian-splat/core';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer';
import { toViewer } from './camera/orbit.js';
import { unproject } from './camera/projection.js';
import type { SceneBounds } from './camera/settings.js';
import { ScenePoint } from './camera/values.js';
import type { CameraController } from './controllers/camera-controller.js';
import type { ViewController } from './controllers/view-controller.js';
import { isGone } from './gpu/device-failures.js';

/** A box in viewer space, its sides along the axes. */
export interface SceneBox {
  readonly min: ScenePoint;
  readonly max: ScenePoint;
}

export interface QueryHost {
  readonly camera: CameraController;
  /** Where all that is shown is; null while nothing is. */
  readonly bounds: SceneBounds | null;
  /** Looks into the last frame. Rejects if it is gone. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  readonly view: Pick<ViewController, 'painter'>;
  /** The camera of the last frame, in its pixels; undefined before there is one. */
  readonly drawnFrom: Camera | undefined;
  readonly element: HTMLElement;
}

/** Questions about the scene on show: where it is, and what lies under a point of the page. */
export class SceneQueries {
  readonly #host: QueryHost;

  constructor(host: QueryHost) {
    this.#host = host;
  }

  /** Box around nearly all of the scene; null while none is on show. */
  get box(): SceneBox | null {
    const { camera, bounds } = this.#host;
    if (bounds === null) return null;
    const [a, b] = [toViewer(camera.viewerFrame, bounds.min), toViewer(camera.viewerFrame, bounds.max)];
    const corner = (pick: (p: number, q: number) => number): ScenePoint =>
      new ScenePoint(pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2]));
    return { min: corner(Math.min), max: corner(Math.max) };
  }

  /**
   * The visible surface under a point of the page, read back from the GPU beside the frames.
   * @param clientX CSS pixels, as of a MouseEvent.
   * @returns null beside the scene, where it is more transparent than not, or if the frame is gone meanwhile.
   */
  async positionFromPoint(clientX: number, clientY: number): Promise<ScenePoint | null> {
    const { camera, view, drawnFrom: drawn, element } = this.#host;
    const { painter } = view;
    const { left, top, width, height } = element.getBoundingClientRect();
    if (drawn === undefined || painter === null || element.clientWidth === 0) return null;
    // The page's pixels are the element's own, scaled by transforms and zooms around it.
    const ownX = ((clientX - left) * element.offsetWidth) / width;
    const ownY = ((clientY - top) * element.offsetHeight) / height;
    const x = ((ownX - element.clientLeft) * drawn.width) / element.clientWidth;
    const y = ((ownY - element.clientTop) * drawn.height) / element.clientHeight;
    if (!(x >= 0 && y >= 0 && x < drawn.width && y < drawn.height)) return null;
    try {
      const [answer] = await this.#host.probe([{ x, y }]);
      if (!answer || answer.depth === null) return null;
      const point = unproject(drawn, { x, y, depth: answer.depth });
      return new ScenePoint(...toViewer(camera.viewerFrame, point));
    } catch (error) {
      // A device that was lost meanwhile has nothing more to say, and its loss is told elsewhere.
      if (await isGone(painter)) return null;
      throw error;
    }
  }
}
