/** Loaded only if a page requests the contribution of its splats. */
import type { Camera, SplatFilter } from '@gaussian-splat/core';
import { Viewpoint, type FrameSettings, type World } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs, readBackWith, untilItHasRoom } from '@gaussian-splat/renderer/tools';
import type { ReadCounts } from './backend.js';

/** Source of the counts: a backend. */
export interface Counted {
  readonly device: GPUDevice;
  readonly isDestroyed: boolean;
  readonly viewpoint: Pick<Viewpoint, 'statistics'>;
  readonly view: { readonly world: World; readonly settings: FrameSettings; readonly filter: SplatFilter | undefined };
}

/** Minimum weight, alpha times transmittance, that is visible on an 8-bit display: half a step. */
const MIN_WEIGHT = 0.5 / 255;
/** Splats of a chunk, because whole chunks are recorded. */
const CHUNK = 256;

/** Reads the counts of the last frame, and of a view. Reads back from the GPU: for panels, not for frames. */
export async function readCounts(viewport: Counted, camera: Camera): Promise<ReadCounts> {
  const { visible, overflow } = await viewport.viewpoint.statistics();
  if (viewport.isDestroyed) throw new Error('the frame is gone');
  return { drawn: visible, left: overflow, contributed: await countContributing(viewport, camera) };
}

/**
 * Counts the splats that are visible in some pixel of a view. Draws the view with the compute rasterizer, independent
 * of the page's, and reads all weights back: for panels, not for frames.
 */
async function countContributing({ device, view }: Counted, camera: Camera): Promise<number> {
  const { world, settings, filter } = view;
  const { STORAGE, COPY_SRC } = GPUBufferUsage;
  const size =
    4 *
    CHUNK *
    Math.max(
      1,
      world.placements
        .flatMap(({ scene, visible }) => (visible ? scene.pages : []))
        .reduce((sum, { count }) => sum + Math.ceil(count / CHUNK), 0),
    );
  const viewpoint = new Viewpoint(device, world, {
    settings: { ...settings, rasterizer: 'tiles', order: 'center' },
  });
  const contributions = device.createBuffer({ label: 'gs.contributions', size, usage: STORAGE | COPY_SRC });
  const auxiliary = new AuxiliaryOutputs({ contributions });
  const target = device.createTexture({
    size: [camera.width, camera.height],
    format: 'rgba16float',
    usage: GPUTextureUsage.RENDER_ATTACHMENT,
  });
  try {
    await untilItHasRoom(() => {
      viewpoint.draw(camera, { target, filter, auxiliary });
      return viewpoint.isComplete();
    });
    const [counted] = await readBackWith(device, [{ buffer: contributions }], (weights) =>
      new Float32Array(weights).reduce((sum, weight) => sum + (weight >= MIN_WEIGHT ? 1 : 0), 0),
    );
    return counted;
  } finally {
    viewpoint.destroy();
    for (const resource of [contributions, target]) resource.destroy();
  }
}
