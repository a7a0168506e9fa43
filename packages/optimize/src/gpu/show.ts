import { World, Viewpoint, type FrameSettings, type GaussianScene } from '@gaussian-splat/renderer';

/** Settings of exact images, so that errors do not include rounding of the renderer. */
const EXACT: FrameSettings = { quality: 'reference' };

/** Returns a viewpoint with the rasterizer `tiles`, for one scene at a time; see {@link show}. */
export const exactViewpoint = (device: GPUDevice): Viewpoint => new Viewpoint(device, new World(), { settings: EXACT });

/** Makes `scene` the only scene of a viewpoint. If it is already shown, the viewpoint keeps its capacity. */
export function show({ world }: Viewpoint, scene: GaussianScene): void {
  const [shown] = world.placements;
  if (shown?.scene === scene) return;
  if (shown) world.remove(shown);
  world.add({ scene });
}
