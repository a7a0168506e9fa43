/** Loaded only where levels of detail are asked for, or the GPU is too slow without. */
import { DetailedGaussians } from '@gaussian-splat/renderer';
import { readPacked, type PackedLevels } from '@gaussian-splat/renderer/tools';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { buffersOf } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';

/**
 * Builds levels of detail of the splats that a scene has on the GPU, in the worker, and puts them beside these. undefined for a scene
 * that is too small to have any, and where the page refuses workers.
 * @param memoryBudget bytes of GPU memory that the scene and its levels may take together; undefined for no limit but the device's
 * @throws GaussianSplatError `out-of-memory/*`, or the signal's reason
 */
export async function buildLevels(
  scene: LoadedGaussians,
  loader: SceneLoader,
  memoryBudget: number | undefined,
  signal: AbortSignal,
): Promise<DetailedGaussians | undefined> {
  const { device, gaussians } = scene;
  const packed = await readPacked(device, gaussians, () => {
    signal.throwIfAborted();
    // A sequence frees them when it puts others in their place.
    if (scene.gaussians !== gaussians) throw new Error('other splats are shown');
  });
  signal.throwIfAborted();
  // Its arrays are the worker's afterwards. The page's own thread would stand still for seconds.
  const nothing = async (): Promise<undefined> => undefined;
  const transfer = buffersOf(packed);
  const levels = await loader.ask<PackedLevels | undefined>({ type: 'levels', packed }, signal, nothing, { transfer });
  if (levels === undefined) return undefined;
  const left = memoryBudget === undefined ? undefined : memoryBudget - gaussians.byteLength;
  const detailed = await DetailedGaussians.upload(device, gaussians, levels, { memoryBudget: left });
  if (!signal.aborted) return detailed;
  detailed.destroy();
  throw signal.reason;
}
