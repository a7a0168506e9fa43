/**
 * Builds levels of detail. The module is loaded only if the page requests levels, or if the GPU is too slow without
 * them.
 */
import { DetailedGaussians } from '@gaussian-splat/renderer';
import { readPacked } from '@gaussian-splat/renderer/tools';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { buffersOf } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';

/**
 * Builds levels of detail for the splats of a scene, in the worker, and uploads them. Returns undefined for a scene
 * that is too small for levels, and if the page does not allow workers.
 * @param memoryBudget Maximum GPU memory of the scene and its levels, in bytes; undefined if only the device limits it.
 * @throws GaussianSplatError `out-of-memory/*`, or the signal's reason.
 */
export async function buildLevels(
  scene: LoadedGaussians,
  loader: SceneLoader,
  memoryBudget: number | undefined,
  signal: AbortSignal,
): Promise<DetailedGaussians | undefined> {
  const { place, gaussians } = scene;
  const packed = await readPacked(place.device, gaussians, () => {
    signal.throwIfAborted();
    // A sequence frees the splats when it replaces them.
    if (scene.gaussians !== gaussians) throw new Error('other splats are shown');
  });
  signal.throwIfAborted();
  // The arrays are transferred to the worker, because building levels would block the main thread for seconds.
  const transfer = buffersOf(packed);
  const levels = await loader.ask('levels', packed, signal, { transfer });
  if (levels === undefined) return undefined;
  const left = memoryBudget === undefined ? undefined : memoryBudget - gaussians.byteLength;
  const detailed = await DetailedGaussians.upload(place.device, gaussians, levels, { memoryBudget: left });
  if (!signal.aborted) return detailed;
  detailed.destroy();
  throw signal.reason;
}
