/** The functions of shaders/shared/detail.wgsl in plain TypeScript; and the tree behind the rows of a packed scene. */
import { eyeOf, type Camera } from '@gaussian-splat/core';
import type { PackedGaussians } from '@gaussian-splat/renderer';
import { constants, DETAIL_NUMBERS, DETAIL_PLACES } from '@gaussian-splat/renderer/stages';

export interface DetailView {
  readonly camera: Camera;
  /** Pixels. */
  readonly allowed: number;
  /** Octaves. */
  readonly fade: number;
}

/** First chunk of each level, finest first, and behind the last the number of all chunks. */
export function levelStarts({ leafCount = 0, count }: PackedGaussians): number[] {
  const starts = [0];
  for (let splats = leafCount; starts.at(-1)! < count / constants.CULL_GROUP; splats = Math.ceil(splats / 4)) {
    starts.push(starts.at(-1)! + Math.ceil(splats / constants.CULL_GROUP));
  }
  return starts;
}

/** A leaf chunk, the chunk that stands for it, and so on. */
export function pathOf(starts: readonly number[], leaf: number): number[] {
  return Array.from({ length: starts.length - 1 }, (_, level) => starts[level] + Math.floor(leaf / 4 ** level));
}

/** Pixels that a chunk (`sphere`, `fullError`) or the one above it (`parentSphere`, `parentError`) is off. */
export function screenError(rows: Float32Array, chunk: number, camera: Camera, isParent: boolean): number {
  const at = DETAIL_NUMBERS * chunk;
  const sphere = at + (isParent ? DETAIL_PLACES.parentSphere : DETAIL_PLACES.sphere);
  const error = rows[at + (isParent ? DETAIL_PLACES.parentError : DETAIL_PLACES.fullError)];
  const eye = eyeOf(camera.worldToCamera);
  const distance = Math.hypot(rows[sphere] - eye[0], rows[sphere + 1] - eye[1], rows[sphere + 2] - eye[2]);
  return (Math.max(camera.fx, camera.fy) * error) / Math.max(distance - rows[sphere + 3], camera.near);
}

const { FADE_STEPS, ARRIVAL_STEPS, ALL_STEPS } = constants;

function refined(pixels: number, { allowed, fade }: DetailView): number {
  if (pixels > allowed) return FADE_STEPS;
  if (fade <= 0 || pixels < constants.SMALLEST_ERROR) return 0;
  return nearestStep(1 + Math.log2(pixels / allowed) / fade, FADE_STEPS);
}

const nearestStep = (share: number, steps: number): number => Math.floor(Math.min(1, Math.max(0, share)) * steps + 0.5);

/** Weight with which a chunk is drawn. */
export function shareDrawn(rows: Float32Array, chunk: number, view: DetailView): number {
  const at = DETAIL_NUMBERS * chunk;
  const full = rows[at + DETAIL_PLACES.fullError];
  const below = full > 0 ? nearestStep(rows[at + DETAIL_PLACES.error] / full, ARRIVAL_STEPS) : 0;
  const bits = new Uint32Array(rows.buffer, rows.byteOffset + 4 * (at + DETAIL_PLACES.children), 1)[0];
  const own = below * refined(screenError(rows, chunk, view.camera, false), view);
  const above = (bits >>> constants.CHILD_PAGE_BITS) * refined(screenError(rows, chunk, view.camera, true), view);
  return Math.max(0, above - own) / ALL_STEPS;
}
