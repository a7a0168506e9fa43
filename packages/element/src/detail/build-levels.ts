/** Loaded only if levels of detail are requested, or the GPU is too slow without. */
import { DetailedGaussians } from '@gaussian-splat/renderer';
import { readPacked, type PackedLevels } from '@gaussian-splat/renderer/tools';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { buffersOf } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';

/**
 * Builds levels of detail for the splats of a scene on the GPU, in the worker, and adds them. undefined for a scene
 * that is too small for any, and if the page does not allow workers.
 * @param memoryBudget Upper limit of the GPU memory of the scene and its levels in bytes; undefined for no limit but
 * the device's.
 * @throws GaussianSplatError `out-of-memory/*`, or the signal's reason.
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
    // A sequence frees them when it replaces the splats.
    if (scene.gaussians !== gaussians) throw new Error('other splats are shown');
  });
  signal.throwIfAborted();
  // Its arrays are transferred to the worker, because the main thread would be blocked for seconds.
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
