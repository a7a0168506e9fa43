import { TEXTURE_USAGE } from './gpu/kernel.js';
import { captureWith, imageFor, type CaptureRequest } from './capture.js';
import { DepthMaps } from './rasterizers/depth-maps.js';
import type { Viewpoint } from './viewpoint.js';
import type { Placement } from './world.js';

/** A frame without meshes: see {@link renderDepth}. */
export type DepthRequest = Omit<CaptureRequest, 'auxiliary' | 'depth' | 'project'>;

/**
 * Depth and identity of each pixel, row by row from the top. A splat has the weight w, its opacity at the pixel times
 * the transmittance of the splats in front of it. Its depth d is that of its highest density along the ray of the
 * pixel, but at least 0.5 and at most 2 times the depth of its center. Depths are in world units along the optical axis.
 */
export interface DepthImage {
  readonly width: number;
  readonly height: number;
  /** [height, width, 4] premultiplied red, green, blue and alpha. */
  readonly color: Float32Array;
  /**
   * [height, width] median depth: d of the first splat, from near to far, behind which half of the light or less is
   * left. 0 if the coverage is below 0.5. It lies on a surface, unlike {@link expectedDepth}.
   */
  readonly depth: Float32Array;
  /**
   * [height, width] expected depth: Σ w d / Σ w. 0 without splats. At the edge of an object it lies between the object
   * and its background, where there is nothing.
   */
  readonly expectedDepth: Float32Array;
  /** [height, width] coverage Σ w, 0..1: 1 minus the transmittance of all splats. */
  readonly coverage: Float32Array;
  /**
   * [height, width] id of the scene with the largest sum of w: its index in {@link owners} plus 1, or 0 without splats.
   * Exact for up to 16 scenes in four pixels that are one above the other.
   */
  readonly ids: Uint32Array;
  /** Scenes by their ids, from 1 on. */
  readonly owners: readonly Placement[];
}

/**
 * Draws one image, and measures depth and identity in the same pass. Draws again if the image did not fit the buffers
 * of the viewpoint. Cameras may be orthographic.
 *
 * ```ts
 * const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: 'tiles' } });
 * const { depth, ids, owners } = await renderDepth(device, viewpoint, { camera });
 * ```
 * @throws GaussianSplatError `unsupported/limits` for a viewpoint without the rasterizer `tiles`; `argument/value` for
 * the order `pixel`; as {@link Viewpoint.draw} does.
 */
export async function renderDepth(device: GPUDevice, viewpoint: Viewpoint, request: DepthRequest): Promise<DepthImage> {
  const { width, height } = request.camera;
  const texture = imageFor(device, request.camera, TEXTURE_USAGE.storageBinding);
  const maps = new DepthMaps(device, texture);
  try {
    const settings = { ...(request.settings ?? viewpoint.settings), resolutionScale: 1 };
    const frame = { ...request, settings, auxiliary: maps, project: maps.project };
    const [color, measured] = await captureWith(device, viewpoint, frame, [texture]);
    const channel = (k: number): Float32Array =>
      Float32Array.from({ length: width * height }, (_, i) => measured[4 * i + k]);
    const [expectedDepth, depth, coverage] = [0, 1, 2].map(channel);
    return {
      width,
      height,
      color,
      depth,
      expectedDepth,
      coverage,
      ids: Uint32Array.from(channel(3)),
      owners: maps.owners,
    };
  } finally {
    maps.destroy();
    texture.destroy();
  }
}
