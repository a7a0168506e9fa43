/** Loaded only when a page asks what its splats contribute. */
import type { Camera, SplatFilter } from '@gaussian-splat/core';
import { Viewpoint, type FrameSettings, type World } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs, readBackWith, untilItHasRoom } from '@gaussian-splat/renderer/tools';
import type { ReadCounts } from './painter.js';

/** What is counted of: a viewport. */
export interface Counted {
  readonly device: GPUDevice;
  readonly isDestroyed: boolean;
  readonly viewpoint: Pick<Viewpoint, 'statistics'>;
  readonly view: { readonly world: World; readonly settings: FrameSettings; readonly filter: SplatFilter | undefined };
}

/** Weight, alpha times transmittance, from which on a splat can be told on a display of 8 bits: half a step. */
const LEAST_WEIGHT = 0.5 / 255;
/** Splats of a chunk: noted are whole ones. */
const CHUNK = 256;

/** Counts of the last frame of a viewport, and of a view. Reads back from the GPU: for panels, not for frames. */
export async function readCounts(viewport: Counted, camera: Camera): Promise<ReadCounts> {
  const { visible, overflow } = await viewport.viewpoint.statistics();
  if (viewport.isDestroyed) throw new Error('the frame is gone');
  return { drawn: visible, left: overflow, contributed: await countContributing(viewport, camera) };
}

/**
 * Counts the splats that some pixel of a view shows. Draws the view with the compute rasterizer, whatever the page uses, and reads all weights back: for
 * panels, not for frames.
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
      new Float32Array(weights).reduce((sum, weight) => sum + (weight >= LEAST_WEIGHT ? 1 : 0), 0),
    );
    return counted;
  } finally {
    viewpoint.destroy();
    for (const resource of [contributions, target]) resource.destroy();
  }
}
