/** Loaded only when a page asks what its splats contribute. */
import type { Camera } from '@gaussian-splat/core';
import { UncheckedViewpoint } from '@gaussian-splat/renderer';
import type { ReadCounts } from '../stats.js';
import type { Viewport } from './viewport.js';

/** Weight, alpha times transmittance, from which on a splat can be told on a display of 8 bits: half a step. */
const LEAST_WEIGHT = 0.5 / 255;
/** Splats of a chunk: noted are whole ones. */
const CHUNK = 256;
/** Frames until buffers have room for all. */
const MOST_TRIES = 4;

/** Counts of the last frame of a viewport, and of a view. Reads back from the GPU: for panels, not for frames. */
export async function readCounts(viewport: Viewport, camera: Camera): Promise<ReadCounts> {
  const { visible, overflow } = await viewport.viewpoint.statistics();
  if (viewport.isDestroyed) throw new Error('the frame is gone');
  return { drawn: visible, left: overflow, contributed: await countContributing(viewport, camera) };
}

/**
 * Counts the splats that some pixel of a view shows. Draws the view with the compute rasterizer, whatever the page uses, and reads all weights back: for
 * panels, not for frames.
 */
async function countContributing({ device, view }: Viewport, camera: Camera): Promise<number> {
  const { world, settings, filter } = view;
  const { STORAGE, COPY_SRC, COPY_DST, MAP_READ } = GPUBufferUsage;
  const size =
    4 *
    CHUNK *
    Math.max(
      1,
      world.placements
        .flatMap(({ scene, visible }) => (visible ? scene.pages : []))
        .reduce((sum, { count }) => sum + Math.ceil(count / CHUNK), 0),
    );
  const viewpoint = new UncheckedViewpoint(device, world, {
    settings: { ...settings, rasterizer: 'tiles', order: 'center' },
  });
  const contributions = device.createBuffer({ label: 'gs.contributions', size, usage: STORAGE | COPY_SRC });
  const staging = device.createBuffer({ label: 'gs.contributions.read', size, usage: MAP_READ | COPY_DST });
  const target = device.createTexture({
    size: [camera.width, camera.height],
    format: 'rgba16float',
    usage: GPUTextureUsage.RENDER_ATTACHMENT,
  });
  try {
    for (let tries = 0; tries < MOST_TRIES; tries++) {
      viewpoint.draw(camera, { target, filter, auxiliary: { contributions } });
      if (await viewpoint.isComplete()) break;
    }
    const encoder = device.createCommandEncoder({ label: 'gs.contributions' });
    encoder.copyBufferToBuffer(contributions, 0, staging, 0, size);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(GPUMapMode.READ);
    return new Float32Array(staging.getMappedRange()).reduce(
      (sum, weight) => sum + (weight >= LEAST_WEIGHT ? 1 : 0),
      0,
    );
  } finally {
    viewpoint.destroy();
    for (const resource of [contributions, staging, target]) resource.destroy();
  }
}
