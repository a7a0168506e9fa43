import { multiply, type Camera, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { DATA_WIDTH, GlGaussians, GlRenderer } from '@gaussian-splat/renderer/webgl';
import type { SceneLoader } from '../../loading/scene-loader.js';
import { packSplats, type SplatRow } from '../../shared/splat-file.js';

/** Number of splats of the ring, its radius in meters, and standard deviation of a splat in meters. */
const [RING_SPLATS, RING_RADIUS, RING_SIGMA] = [48, 0.25, 0.012];

/** Position of a view's rectangle in a framebuffer, pixels. */
interface Rectangle {
  readonly framebuffer: WebGLFramebuffer | null;
  readonly x: number;
  readonly y: number;
}

/** A few splats that the element has created, drawn with WebGL. */
export class MarkerSplats {
  #renderer: GlRenderer | undefined;

  /**
   * Uploads the splats, which are drawn when that is done.
   * @param rows Splats in one plane, so that their order does not matter.
   */
  constructor(gl: WebGL2RenderingContext, rows: readonly SplatRow[], loader: SceneLoader, signal: AbortSignal) {
    this.#load(gl, rows, loader, signal).catch(() => undefined);
  }

  async #load(
    gl: WebGL2RenderingContext,
    rows: readonly SplatRow[],
    loader: SceneLoader,
    signal: AbortSignal,
  ): Promise<void> {
    const packed = await packSplats(rows, loader, signal);
    const gaussians = await GlGaussians.upload(gl, packed);
    const renderer = new GlRenderer(gl, gaussians);
    const free = (): void => {
      this.#renderer = undefined;
      renderer.destroy();
      gaussians.destroy();
    };
    if (signal.aborted) return free();
    signal.addEventListener('abort', free, { once: true });
    const length = DATA_WIDTH * Math.max(1, Math.ceil(packed.count / DATA_WIDTH));
    renderer.setOrder(
      Uint32Array.from({ length }, (_, i) => i),
      packed.count,
    );
    this.#renderer = renderer;
  }

  /**
   * Draws the markers over the current image.
   * @param toWorld Transform from the coordinates of the markers to the world of the camera.
   */
  draw(camera: Camera, target: Rectangle, toWorld: Matrix4): void {
    const renderer = this.#renderer;
    if (!renderer) return;
    const placed = { ...camera, worldToCamera: multiply(camera.worldToCamera, toWorld) };
    renderer.render({ camera: placed, shDegree: 0, accumulation: 'rgba16float', resolutionScale: 1 });
    renderer.present(undefined, { ...target, keeps: true });
  }
}

/** Returns the transform of markers: center in meters with y up, scale, and rotation about y in radians. */
export const placeOf = ([x, y, z]: Vector3, size = 1, turn = 0): Matrix4 => {
  const [sin, cos] = [size * Math.sin(turn), size * Math.cos(turn)];
  return [cos, 0, sin, x, 0, size, 0, y, -sin, 0, cos, z, 0, 0, 0, 1];
};

/** Returns a horizontal ring around the origin. */
export const ring = (): SplatRow[] =>
  Array.from({ length: RING_SPLATS }, (_, i): SplatRow => {
    const angle = (2 * Math.PI * i) / RING_SPLATS;
    const place: Vector3 = [RING_RADIUS * Math.cos(angle), 0, RING_RADIUS * Math.sin(angle)];
    return [place, [RING_SIGMA, RING_SIGMA, RING_SIGMA], [50, 180, 255, 240]];
  });
