import { World, Viewpoint, type FrameSettings, type GaussianScene } from '@gaussian-splat/renderer';

/** Exact, so that no rounding is taken for an effect of a change. */
const EXACT: FrameSettings = { quality: 'reference' };

/** A viewpoint of one scene at a time, see {@link show}, with the rasterizer `tiles`. */
export const exactViewpoint = (device: GPUDevice): Viewpoint => new Viewpoint(device, new World(), { settings: EXACT });

/** Makes this the only scene of the viewpoint. One that is already there keeps the room that its frames have found. */
export function show({ world }: Viewpoint, scene: GaussianScene): void {
  const [shown] = world.placements;
  if (shown?.scene === scene) return;
  if (shown) world.remove(shown);
  world.add({ scene });
}
