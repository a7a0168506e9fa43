import { GaussianSplatError } from '@gaussian-splat/core';
import type { EvaluationViews } from './evaluator.js';

/** An image, [height, width, 4] premultiplied red, green, blue and alpha in float32. */
export type Image = Float32Array;

/**
 * Returns the mean squared difference of red, green and blue, peak 1, over the pixels that the reference covers (alpha
 * above 0). 0 if the reference covers none.
 */
export function meanSquare(image: Image, reference: Image): number {
  let sum = 0;
  let pixels = 0;
  for (let i = 0; i < reference.length; i += 4) {
    if (reference[i + 3] === 0) continue;
    pixels++;
    for (let channel = i; channel < i + 3; channel++) sum += (image[channel] - reference[channel]) ** 2;
  }
  return pixels === 0 ? 0 : sum / (3 * pixels);
}

export const decibels = (meanSquare: number): number => -10 * Math.log10(meanSquare);
export const meanSquareOf = (decibels: number): number => 10 ** (-decibels / 10);
export const mean = (values: readonly number[]): number =>
  values.reduce((sum, value) => sum + value, 0) / values.length;

/**
 * Returns the mean of the errors of several views.
 * @param errors Mean squared errors of the views that show the scene.
 * @throws GaussianSplatError `argument/value` if no view shows the scene, because no cut can then be evaluated.
 */
export function errorTogether(errors: readonly number[], views: EvaluationViews): number {
  if (errors.length > 0) return mean(errors);
  throw new GaussianSplatError('argument/value', {
    where: views === 'heldOut' ? 'held-out views' : 'searched views',
    expected: 'views that show some of the scene',
    found: 'none that does',
    remedy:
      'check the axes (OpenCV: x right, y down, z forward), the units and the near planes of the cameras, and whether the scene is visible',
  });
}
