/** Measures depth and identity of each pixel, in images of any size. Loaded with the first call of `renderDepth()`. */
import type { Camera } from '@gaussian-splat/core';
import { Viewpoint } from '@gaussian-splat/renderer';
import { renderDepth, type DepthImage } from '@gaussian-splat/renderer/depth';
import type { WebGpuBackend } from '../../gpu/webgpu-backend.js';
import { worldOf } from '../../shared/take-alpha.js';
import type { SourceEntry } from '../../viewer/source-entry.js';
import type { Viewer } from '../../viewer/viewer.js';
import { nothingToDraw, sizeOf, type ImageOptions } from './capture-image.js';

/** Options of `renderDepth()`. */
export type DepthOptions = Pick<ImageOptions, 'width' | 'height'>;

/**
 * Depth and identity of each pixel of the current view, row by row from the top: see `DepthImage` of the renderer.
 * Depths are in meters along the optical axis.
 */
export interface MeasuredView extends Omit<DepthImage, 'owners'> {
  /** This element or a child of it, by ids from 1 on. */
  readonly owners: readonly Element[];
  /**
   * Camera of the image in the axes of OpenCV. Its `worldToCamera` takes positions of the element's own file, whose up
   * direction is the attribute `up`.
   */
  readonly camera: Camera;
}

/**
 * Measures depth and identity of the current view.
 * @throws DOMException `InvalidStateError` without a scene; `NotSupportedError` in a scene with meshes. @throws
 * GaussianSplatError `unsupported/webgl` without WebGPU.
 */
export async function measureDepth(host: Viewer, options: DepthOptions): Promise<MeasuredView> {
  await host.present();
  const { backend } = host.view;
  const { canvas, sources } = host;
  if (!backend || !canvas || host.drawnFrom === undefined) throw nothingToDraw();
  const { device, view } = backend as WebGpuBackend;
  const size = sizeOf(options, canvas, device.limits.maxTextureDimension2D, 'renderDepth') ?? canvas;
  const camera = host.camera.view(size.width, size.height);
  if (host.drawBeneath({ camera } as Parameters<Viewer['drawBeneath']>[0]).depth)
    throw new DOMException('renderDepth(): expected splats alone, found a mesh: hide it', 'NotSupportedError');
  host.prepareFrame();
  const { members } = sources;
  const world = worldOf(members);
  const settings = { ...view.settings, rasterizer: 'tiles', order: 'center' } as const;
  const viewpoint = new Viewpoint(device, world, { settings });
  try {
    const image = await renderDepth(device, viewpoint, { camera, filter: view.filter });
    const elements = members.map((member) => childOf(host, (entry) => entry.member === member));
    const owners = image.owners.map((placement) => elements[world.placements.indexOf(placement)]);
    return { ...image, owners, camera };
  } finally {
    viewpoint.destroy();
  }
}

/** Returns the child whose source fulfills a condition, or the element itself. */
const childOf = ({ element }: Viewer, isIt: (entry: SourceEntry) => boolean): Element =>
  [...element.children].find((child) => {
    const { entry } = child as { readonly entry?: SourceEntry };
    return entry !== undefined && isIt(entry);
  }) ?? element;
