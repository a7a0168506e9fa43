import { multiply, type Camera, type Vector3 } from '@gaussian-splat/core';
import { DATA_WIDTH, GlGaussians, GlRenderer } from '@gaussian-splat/renderer/webgl';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { XrRectangle } from './xr-session.js';

/** Bytes of a splat in a `.splat` file: position and scale as float32, color and opacity, rotation. */
const ROW_BYTES = 32;
/** Splats of the ring, its radius in meters, and how thick it is. */
const [RING_SPLATS, RING_RADIUS, RING_SIGMA] = [48, 0.25, 0.012];
/** Of the disc's radius, the part that is one standard deviation; and its opacity in the middle, of 255. */
const [DISC_SIGMA, DISC_OPACITY] = [0.45, 102];

/** A few splats of the element's own: a ring where a teleport goes, or a soft dark disc under an object. No mesh is drawn for either. */
export class MarkerSplats {
  #renderer: GlRenderer | undefined;

  constructor(gl: WebGL2RenderingContext, shape: 'ring' | 'disc', loader: SceneLoader, signal: AbortSignal) {
    this.#load(gl, shape, loader, signal).catch(() => undefined);
  }

  async #load(
    gl: WebGL2RenderingContext,
    shape: 'ring' | 'disc',
    loader: SceneLoader,
    signal: AbortSignal,
  ): Promise<void> {
    const url = URL.createObjectURL(new Blob([shape === 'ring' ? ring() : disc()]));
    const request = { url: `${url}#marker.splat`, credentials: 'same-origin', sh: 'auto', levels: false } as const;
    const { packed } = await loader.load(request, signal, () => undefined).finally(() => URL.revokeObjectURL(url));
    const gaussians = await GlGaussians.upload(gl, packed);
    const renderer = new GlRenderer(gl, gaussians);
    const free = (): void => {
      renderer.destroy();
      gaussians.destroy();
    };
    if (signal.aborted) return free();
    signal.addEventListener('abort', free, { once: true });
    // All lie in one plane: any order shows the same.
    renderer.setOrder(
      Uint32Array.from({ length: DATA_WIDTH }, (_, i) => i),
      packed.count,
    );
    this.#renderer = renderer;
  }

  /** Draws it over what is there. @param at of its middle, meters, in the camera's world, y up @param size factor of a meter */
  draw(camera: Camera, target: XrRectangle, [x, y, z]: Vector3, size = 1): void {
    const renderer = this.#renderer;
    if (!renderer) return;
    const place = [size, 0, 0, x, 0, size, 0, y, 0, 0, size, z, 0, 0, 0, 1];
    const placed = { ...camera, worldToCamera: multiply(camera.worldToCamera, place) };
    renderer.render({ camera: placed, shDegree: 0, accumulation: 'rgba16float', resolutionScale: 1 });
    renderer.present(undefined, { ...target, keeps: true });
  }
}

type Row = readonly [place: Vector3, scale: Vector3, color: readonly [number, number, number, number]];

function file(rows: readonly Row[]): ArrayBuffer {
  const view = new DataView(new ArrayBuffer(ROW_BYTES * rows.length));
  rows.forEach(([place, scale, color], i) => {
    const at = ROW_BYTES * i;
    [...place, ...scale].forEach((value, k) => view.setFloat32(at + 4 * k, value, true));
    // No rotation: 1, 0, 0, 0.
    [...color, 255, 128, 128, 128].forEach((value, k) => view.setUint8(at + 24 + k, value));
  });
  return view.buffer;
}

const ring = (): ArrayBuffer =>
  file(
    Array.from({ length: RING_SPLATS }, (_, i): Row => {
      const angle = (2 * Math.PI * i) / RING_SPLATS;
      const place: Vector3 = [RING_RADIUS * Math.cos(angle), 0, RING_RADIUS * Math.sin(angle)];
      return [place, [RING_SIGMA, RING_SIGMA, RING_SIGMA], [50, 180, 255, 240]];
    }),
  );

const disc = (): ArrayBuffer =>
  file([
    [
      [0, 0, 0],
      [DISC_SIGMA, 1e-4, DISC_SIGMA],
      [0, 0, 0, DISC_OPACITY],
    ],
  ]);
