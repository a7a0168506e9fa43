/** Options for selecting variants for first frames, and the handling of failures. */
import { GaussianSplatError } from '@gaussian-splat/core';
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
