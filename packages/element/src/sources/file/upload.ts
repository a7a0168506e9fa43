import { GaussianBuffers } from '@gaussian-splat/renderer';
import type { LoadedFacts, LoadedScene } from '../../loading/protocol.js';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { DeviceLease } from '../../gpu/shared-device.js';

export interface SceneUploadOptions {
  readonly signal: AbortSignal;
  /** Maximum GPU memory of the scene, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  /** Number of submissions into which the work of a frame is divided. */
  readonly submissions: number;
}

/**
 * Uploads a scene to the GPU. The returned scene owns the lease. Rejects with GaussianSplatError `out-of-memory/*`, the
 * signal's reason, or as `ready` does; the caller then releases the lease.
 * @param ready Resolves when the scene can be drawn, usually during the upload.
 */
export async function upload(
  lease: DeviceLease,
  scene: LoadedScene,
  options: SceneUploadOptions,
  ready: Promise<unknown> = Promise.resolve(),
): Promise<LoadedGaussians> {
  const gaussians = await GaussianBuffers.upload(lease.device, scene.packed, options);
  try {
    await ready;
    options.signal.throwIfAborted();
  } catch (error) {
    gaussians.destroy();
    throw error;
  }
  return shown(lease, gaussians, scene, options);
}

/** Returns a scene from uploaded Gaussians and the properties of its file. The scene owns the lease. */
export const shown = (
  lease: DeviceLease,
  gaussians: GaussianBuffers,
  { bounds, ...facts }: LoadedFacts,
  { submissions }: Pick<SceneUploadOptions, 'submissions'>,
): LoadedGaussians => new LoadedGaussians(lease, gaussians, bounds, submissions, facts);
