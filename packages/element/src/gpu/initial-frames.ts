/** Options for selecting variants for first frames, and the handling of failures. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import type { OpenOptions } from '../sources/source-kind.js';
import { limitScenes } from './memory-budget.js';
import type { DeviceLease } from './shared-device.js';
import { canvasFormat } from './webgpu-backend.js';

/** Returns the format of the images for which variants are selected, which is that of canvases. */
export const images = (): { format: GPUTextureFormat } => ({ format: canvasFormat() });

/**
 * Throws an error if it is a failed self-test, which ends the load. Other failures, such as failed timings, are
 * ignored.
 */
export function unlessWrong(error: unknown): void {
  if (error instanceof GaussianSplatError && error.code === 'unsupported/wrong-image') throw error;
}

/**
 * Selects the variants for the first frame, then reports the GPU memory of a new scene, in bytes. Rejects with the
 * reason of the signal, or if a self-test has failed.
 */
export async function prepareDevice(
  { device }: DeviceLease,
  { memoryBudget, signal, beforeUpload }: Pick<OpenOptions, 'memoryBudget' | 'signal' | 'beforeUpload'>,
  byteLength: number,
): Promise<void> {
  await pickInitialVariants(device, images()).catch(unlessWrong);
  limitScenes(device, memoryBudget);
  signal.throwIfAborted();
  beforeUpload(byteLength);
}
