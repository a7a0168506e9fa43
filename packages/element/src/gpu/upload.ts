import { GaussianBuffers } from '@gaussian-splat/renderer';
import type { LoadedFacts, LoadedScene } from '../loading/protocol.js';
import { LoadedGaussians } from './loaded-gaussians.js';
import type { DeviceLease } from './shared-device.js';

export interface SceneUploadOptions {
  readonly signal: AbortSignal;
  /** Upper limit of the scene's GPU memory in bytes; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** Number of submissions of a frame. */
  readonly submissions: number;
}

/**
 * Uploads a scene to the GPU, which then owns the lease. Rejects with GaussianSplatError `out-of-memory/*` or the
 * signal's reason.
 */
export async function upload(
  lease: DeviceLease,
  scene: LoadedScene,
  options: SceneUploadOptions,
): Promise<LoadedGaussians> {
  const gaussians = await GaussianBuffers.upload(lease.device, scene.packed, options);
  if (!options.signal.aborted) return shown(lease, gaussians, scene, options);
  gaussians.destroy();
  throw options.signal.reason;
}

/** A scene that is on the GPU. It owns the lease. */
export const shown = (
  lease: DeviceLease,
  gaussians: GaussianBuffers,
  { bounds, warnings, order, hasMeshes }: LoadedFacts,
  { submissions }: Pick<SceneUploadOptions, 'submissions'>,
): LoadedGaussians => new LoadedGaussians(lease, gaussians, bounds, submissions, { warnings, order, hasMeshes });
