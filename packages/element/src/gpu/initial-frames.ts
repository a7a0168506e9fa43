/** Settings and errors of the frames that variants are chosen for. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { canvasFormat } from './webgpu-backend.js';

/** Format of the canvas. */
export const images = (): { format: GPUTextureFormat } => ({ format: canvasFormat() });

/** Only a failed self-test aborts loading; failed timings do not. */
export function unlessWrong(error: unknown): void {
  if (error instanceof GaussianSplatError && error.code === 'unsupported/wrong-image') throw error;
}
