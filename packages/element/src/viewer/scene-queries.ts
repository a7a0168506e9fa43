import type { Vector3 } from '@gaussian-splat/core';
import type { ViewerFrame } from './camera/orbit.js';
import type { SceneBounds } from './camera/settings.js';
import { ScenePoint } from './camera/values.js';

/** An axis-aligned box in viewer space. */
export interface SceneBox {
  readonly min: ScenePoint;
  readonly max: ScenePoint;
}

/**
 * Returns the box around nearly all visible splats in viewer space; null if there are none. `bounds` are in the frame
 * of the world.
 */
export function boxOf(frame: ViewerFrame, bounds: Pick<SceneBounds, 'min' | 'max'> | null): SceneBox | null {
  if (bounds === null) return null;
  // A rotated box is farthest along each axis at the corner with the extreme of each product.
  const corner = (pick: (p: number, q: number) => number): ScenePoint =>
    new ScenePoint(
      ...(frame.map((row) =>
        row.reduce((sum, value, k) => sum + pick(value * bounds.min[k], value * bounds.max[k]), 0),
      ) as unknown as Vector3),
    );
  return { min: corner(Math.min), max: corner(Math.max) };
}
