import type { SceneSource } from './scene-format.js';

/** Smaller scenes are read as fast as a preview would be. */
const MIN_SPLATS = 50_000;

/** True if somebody wants a preview of a scene of so many splats, and the scene is large enough for one to be worth its time. */
export function previewWanted({ onPreview }: SceneSource, count: number): boolean {
  return onPreview !== undefined && count >= MIN_SPLATS;
}
