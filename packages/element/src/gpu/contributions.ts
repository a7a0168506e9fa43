/** Counts the splats that contribute to a frame. The module is loaded only if a page requests this count. */
import type { Camera, SplatFilter } from '@gaussian-splat/core';
import { Viewpoint, type FrameSettings, type World } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs, readBackWith, untilItHasRoom } from '@gaussian-splat/renderer/tools';
import type { ReadCounts } from './backend.js';

/** The part of a backend whose splats are counted. */
export interface Counted {
  readonly device: GPUDevice;
  readonly isDestroyed: boolean;
  readonly viewpoint: Pick<Viewpoint, 'stats'>;
  readonly view: { readonly world: World; readonly settings: FrameSettings; readonly filter: SplatFilter | undefined };
}

/** Minimum weight, alpha times transmittance, that is visible on an 8-bit display: half of one step. */
const MIN_WEIGHT = 0.5 / 255;
/** Number of splats in a chunk. Weights are recorded for whole chunks. */
const CHUNK = 256;

/**
 * Returns how many splats the last frame drew and left out, and how many contribute to the view of `camera`. Reads
 * back from the GPU, so call it for statistics only. Throws if the backend is destroyed.
 */
export async function readCounts(viewport: Counted, camera: Camera): Promise<ReadCounts> {
  const { visible, overflow } = await viewport.viewpoint.stats();
  if (viewport.isDestroyed) throw new Error('the frame is gone');
  return { drawn: visible, left: overflow, contributing: await countContributing(viewport, camera) };
}

/**
 * Returns the number of splats that are visible in some pixel of a view. Draws the view with the compute rasterizer,
 * whichever the page uses, and reads all weights back. Call it for statistics only.
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
        .flatMap(({ scene, visible }) => (visible ? scene.blocks : []))
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
