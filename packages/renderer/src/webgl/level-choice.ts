/** Selects levels of detail on the CPU, as `shaders/shared/detail.wgsl` does, without cross-fades. */
import { eyeOf, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS, DETAIL_PLACES } from '../levels/chunk-detail.js';

const { CULL_GROUP } = constants;
const { sphere, parentSphere, error, parentError } = DETAIL_PLACES;

export interface LevelChoice {
  /** Position of the eye, relative to the origin of the splat positions. */
  readonly eye: Vector3;
  /** Pixels of a unit at distance 1, the larger of both axes. */
  readonly focal: number;
  /** Minimum distance from the eye. */
  readonly nearest: number;
  readonly isParallel: boolean;
  /** Maximum error of a drawn chunk, pixels; 0 for the finest level. */
  readonly allowed: number;
}

/** @param allowed Maximum error, pixels. */
export function levelChoice(camera: Camera, origin: Vector3, allowed: number): LevelChoice {
  const { worldToCamera: m, fx, fy, near, orthographic: isParallel = false } = camera;
  const nearest = (isParallel ? 1 : near) / Math.hypot(m[8], m[9], m[10]);
  return { eye: subtract(eyeOf(m), origin), focal: Math.max(fx, fy), nearest, isParallel, allowed };
}

/**
 * Returns the ranges [first, end) of splats to draw: along each path from a finest chunk to the root exactly one chunk.
 * @param details Rows of all chunks, including those before `first`.
 */
export function drawnChunks(
  details: Float32Array,
  first: number,
  end: number,
  choice: LevelChoice,
): [number, number][] {
  const ranges: [number, number][] = [];
  for (let from = first; from < end; from += CULL_GROUP) {
    const at = DETAIL_NUMBERS * (from / CULL_GROUP);
    const isFine = pixelsOf(details, at + sphere, details[at + error], choice) <= choice.allowed;
    if (!isFine || pixelsOf(details, at + parentSphere, details[at + parentError], choice) <= choice.allowed) continue;
    const to = Math.min(end, from + CULL_GROUP);
    if (ranges.at(-1)?.[1] === from) ranges.at(-1)![1] = to;
    else ranges.push([from, to]);
  }
  return ranges;
}

/** Returns `screen_error` of detail.wgsl, in pixels. @param at Index of the sphere. @param length World units. */
export function pixelsOf(details: Float32Array, at: number, length: number, choice: LevelChoice): number {
  const { eye, focal, nearest, isParallel } = choice;
  const x = details[at] - eye[0];
  const y = details[at + 1] - eye[1];
  const z = details[at + 2] - eye[2];
  // `Math.hypot` takes several times as long.
  const distance = isParallel ? nearest : Math.max(Math.sqrt(x * x + y * y + z * z) - details[at + 3], nearest);
  return (focal * length) / distance;
}
