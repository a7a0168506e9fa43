import type { GaussianCloud } from '@gaussian-splat/core';
import type { SceneSource } from './scene-format.js';

/** A preview has every so many-th splat. */
export const PREVIEW_STEP = 16;
/** Smaller scenes are read as fast as a preview would be. */
const MIN_SPLATS = 50_000;

/** True if somebody wants a preview of a scene of so many splats, and the scene is large enough for one to be worth its time. */
export function previewWanted({ onPreview }: SceneSource, count: number): boolean {
  return onPreview !== undefined && count >= MIN_SPLATS;
}

/**
 * Makes a selection stand for the whole: `kept` of `all` splats, each larger by the square root of what it stands for, so that they
 * cover the same area. Works in place.
 */
export function sparse<T extends GaussianCloud>(cloud: T, share = 1 / PREVIEW_STEP): T {
  const factor = Math.sqrt(1 / share);
  for (let i = 0; i < cloud.scales.length; i++) cloud.scales[i] *= factor;
  return cloud;
}
