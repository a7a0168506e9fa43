import { World, Viewpoint, type FrameSettings, type GaussianScene } from '@gaussian-splat/renderer';

/** Exact settings, so that rounding is not mistaken for an effect of a change. */
const EXACT: FrameSettings = { quality: 'reference' };

/** A viewpoint for one scene at a time, see {@link show}, with the rasterizer `tiles`. */
export const exactViewpoint = (device: GPUDevice): Viewpoint => new Viewpoint(device, new World(), { settings: EXACT });

/** Makes this the only scene of the viewpoint. The current scene keeps its capacity. */
export function show({ world }: Viewpoint, scene: GaussianScene): void {
  const [shown] = world.placements;
  if (shown?.scene === scene) return;
  if (shown) world.remove(shown);
  world.add({ scene });
}
