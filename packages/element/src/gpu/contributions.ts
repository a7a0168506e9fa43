/** Loaded only when a page asks what its splats contribute. */
import { Renderer, type FrameRequest, type GaussianScene, type RendererOptions } from '@gaussian-splat/renderer';

/** Weight, alpha times transmittance, from which on a splat can be told on a display of 8 bits: half a step. */
const LEAST_WEIGHT = 0.5 / 255;
/** Splats of a chunk: noted are whole ones. */
const CHUNK = 256;
/** Frames until buffers have room for all. */
const MOST_TRIES = 4;

/** A picture at rest. */
export interface View
  extends Pick<FrameRequest, 'camera' | 'detail' | 'splatBudget' | 'filter'>, Pick<RendererOptions, 'quality'> {
  readonly gaussians: GaussianScene;
}

/**
 * Counts the splats that some pixel of a view shows. Draws the view with the compute rasterizer, whatever the page uses, and reads all weights back: for
 * panels, not for frames.
 */
export async function countContributing(device: GPUDevice, { quality, ...view }: View): Promise<number> {
  const { STORAGE, COPY_SRC, COPY_DST, MAP_READ } = GPUBufferUsage;
  const size =
    4 *
    CHUNK *
    Math.max(
      1,
      view.gaussians.pages.reduce((sum, { count }) => sum + Math.ceil(count / CHUNK), 0),
    );
  const renderer = new Renderer(device, { quality, rasterizer: 'tiles' });
  const contributions = device.createBuffer({ label: 'gs.contributions', size, usage: STORAGE | COPY_SRC });
  const staging = device.createBuffer({ label: 'gs.contributions.read', size, usage: MAP_READ | COPY_DST });
  const target = device.createTexture({
    size: [view.camera.width, view.camera.height],
    format: 'rgba16float',
    usage: GPUTextureUsage.RENDER_ATTACHMENT,
  });
  try {
    for (let tries = 0; tries < MOST_TRIES; tries++) {
      renderer.render({ ...view, target, notes: { contributions } });
      if (await renderer.isComplete()) break;
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
    renderer.destroy();
    for (const resource of [contributions, staging, target]) resource.destroy();
  }
}
