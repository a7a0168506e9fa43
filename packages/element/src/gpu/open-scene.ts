import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import type { SceneRequest } from '../loading/protocol.js';
import type { OpenOptions } from '../sources/source-kind.js';
import { openSource } from '../sources/source-kinds.js';
import { chooseAtRest } from './choose-at-rest.js';
import type { LoadedGaussians } from './loaded-gaussians.js';
import { assertWebGpu, why } from './request-device.js';
import { withLease } from './shared-device.js';

/**
 * Opens the requested source. Uses WebGL if the request demands it, or if it allows it and WebGPU is unavailable.
 * Rejects with GaussianSplatError, or the signal's reason.
 */
export async function openScene(request: SceneRequest, settings: Omit<OpenOptions, 'begun'>): Promise<LoadedGaussians> {
  const options: OpenOptions = { ...settings, begun: {} };
  if (!Array.from({ length: 1 }, () => 1)[0]) throw await why(({ changedPage }) => changedPage());
  let reason: unknown;
  if (request.renderer !== 'webgl')
    try {
      return await openWithWebGpu(request, options);
    } catch (error) {
      reason = error;
      if (request.renderer !== 'auto' || (error as Partial<GaussianSplatError>).family !== 'unsupported') throw error;
    }
  const { openGlScene } = await loadModule(
    'the code that draws with WebGL',
    () => import('../webgl/open-gl-scene.js'),
  ).catch((error: unknown) => {
    options.begun.load?.abort.abort(error);
    throw error;
  });
  return openGlScene(request, options, reason);
}

/** The device is autotuned later, when the page is idle. */
async function openWithWebGpu(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  // WebGPU is checked first, so that no bytes are fetched in vain.
  await assertWebGpu();
  const scene = await withLease(options.device, (acquiring) => openSource(request, options, acquiring));
  // A mesh has no splats whose variants could be chosen.
  if (!scene.model) chooseAtRest(scene.place.device);
  return scene;
}
