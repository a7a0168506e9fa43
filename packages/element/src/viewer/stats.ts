import type { Vector3 } from '@gaussian-splat/core';
import type { StreamProgress } from '@gaussian-splat/renderer';
import { faultsOf } from '@gaussian-splat/renderer/tools';
import type { QualityChoice } from './attributes.js';
import type { DynamicQualityReport } from '../dynamic-quality/dynamic-quality-controller.js';
import type { SceneState } from './scene-controller.js';
import type { ElementError } from './errors.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { ReadCounts } from '../gpu/backend.js';

/** Counts of modeled, drawn and visible splats of a scene, its memory, and the reasons for reductions. */
export interface SceneStats {
  /** API that draws the scene. */
  readonly renderer: 'webgpu' | 'webgl';
  /** Number of splats in the file, or maximum number that the generator writes. */
  readonly total: number;
  /** Whether a preview is shown while the scene loads. All counts are then those of the preview. */
  readonly isPreview: boolean;
  /** Number of splats of the file that were left out because they have invalid values. */
  readonly dropped: number;
  /** Number of splats: those of the current frame for a sequence, of the finest level for a scene with levels of detail. */
  readonly splats: number;
  /** Number of splats on the GPU with those of levels of detail; the capacity for a streamed scene. */
  readonly resident: number;
  /**
   * Levels of detail. `splats` is the number of merged splats on the GPU besides the scene's own: 0 for a streamed
   * scene, whose file contains its levels. `pixels` is the allowed error of frames at rest, pixels.
   */
  readonly detail: { readonly splats: number; readonly pixels: number };
  /**
   * Number of splats that the last `updateStats()` found to be drawn: in front of the camera, opaque enough, and
   * covering a pixel. null before the first call.
   */
  readonly drawn: number | null;
  /**
   * Number of splats that change any pixel by at least half of 1/255, at the last `updateStats()`. null before the
   * first call.
   */
  readonly contributing: number | null;
  /** Bytes of GPU memory of the splats and meshes (`scene`), and of the renderer that draws frames (`frames`). */
  readonly bytes: { readonly scene: number; readonly frames: number };
  /** The attribute `quality`. */
  readonly quality: QualityChoice;
  /** Settings for frames at rest and in motion. */
  readonly dynamicQuality: DynamicQualityReport;
  /**
   * Up direction in scene coordinates according to its file, a unit vector; null if the file has none. With several
   * scenes, that of the first.
   */
  readonly up: Vector3 | null;
  /**
   * Features of the files that are not drawn, or may be drawn differently than intended, in English. They are also
   * written to the console.
   */
  readonly warnings: readonly string[];
  /**
   * State of each streamed scene: pages on the GPU and all pages, their splats and bytes, and the largest error of a
   * missing page in pixels. `limit` is why this error does not decrease: `transit`, `memory`, `failure`, or null.
   * `reasons` has a sentence about it.
   */
  readonly streamed: readonly StreamProgress[];
  /** State of the element's own scene, then of each child; empty for an element without children. */
  readonly scenes: readonly ChildStats[];
  /** Reasons for reductions of the scene to save time or memory, in English; empty without reductions. */
  readonly reasons: readonly string[];
}

/** State and memory of one child of the element. */
export interface ChildStats {
  /** The child, or the element itself for its own scene. */
  readonly element: HTMLElement;
  readonly state: SceneState;
  readonly error: ElementError | null;
  /** Number of splats, without those of coarser levels of detail; 0 for a mesh. */
  readonly splats: number;
  /** Number of triangles; 0 for a scene of splats. */
  readonly triangles: number;
  /** Number of splats of the file that were left out because they have invalid values. */
  readonly dropped: number;
  /** Bytes of GPU memory. */
  readonly bytes: number;
}

/** Returns counts and GPU memory of a loaded scene; all 0 for null. */
export const costOf = (
  scene: LoadedGaussians | null,
): Pick<ChildStats, 'splats' | 'triangles' | 'dropped' | 'bytes'> => ({
  splats: scene ? splatsOf(scene.gaussians) : 0,
  triangles: scene?.model?.triangles ?? 0,
  dropped: scene?.gaussians.droppedCount ?? 0,
  bytes: scene ? scene.gaussians.byteLength + (scene.levels?.byteLength ?? 0) + (scene.model?.byteLength ?? 0) : 0,
});

const splatsOf = ({ frameCount, leafCount = Infinity, count }: LoadedGaussians['gaussians']): number =>
  frameCount ?? Math.min(leafCount, count);

/** Input of {@link statsOf} that the scenes themselves do not contain. */
export interface StatsContext {
  readonly quality: QualityChoice;
  readonly dynamicQuality: DynamicQualityReport;
  readonly counts: ReadCounts | undefined;
  readonly isPreview: boolean;
  /** Bytes of GPU memory of the renderer that draws frames. */
  readonly frameBytes: number;
  /** Resolution scale of each side that the overdraw limit requires, 0..1: see `Painter.pixelShare`. Default 1. */
  readonly pixelShare?: number | undefined;
  /** Allowed error of images at rest, pixels. */
  readonly pixels: number | undefined;
  readonly parts: readonly ChildStats[];
}

/** Computes statistics of the shown scenes, at least one, without a readback from the GPU. */
export function statsOf(
  scenes: readonly LoadedGaussians[],
  { quality, dynamicQuality, counts, isPreview, frameBytes, pixelShare = 1, pixels = 0, parts }: StatsContext,
): SceneStats {
  const sum = (of: (scene: LoadedGaussians) => number | undefined): number =>
    scenes.reduce((total, scene) => total + (of(scene) ?? 0), 0);
  const dropped = sum(({ gaussians }) => gaussians.droppedCount);
  const merged = sum(({ gaussians, levels }) => levels && levels.count - gaussians.count);
  const detail = { splats: merged, pixels };
  const streamed = scenes.flatMap(({ gaussians }) => gaussians.progress ?? []);
  return {
    renderer: scenes[0].renderer,
    isPreview,
    splats: sum((scene) => costOf(scene).splats),
    total: sum(totalOf),
    dropped,
    resident: sum(({ gaussians }) => gaussians.count) + merged,
    detail,
    drawn: counts?.drawn ?? null,
    contributing: counts?.contributing ?? null,
    bytes: {
      scene: sum((scene) => costOf(scene).bytes),
      frames: frameBytes,
    },
    quality,
    dynamicQuality,
    up: scenes[0]?.bounds.up ?? null,
    warnings: scenes.flatMap(({ warnings }) => warnings),
    streamed,
    scenes: parts,
    reasons: [
      ...whyPreview(isPreview),
      ...streamed.flatMap(({ reasons }) => reasons),
      ...whyDropped(dropped),
      ...whyDetail(quality, detail),
      ...explainQuality(quality, dynamicQuality),
      ...whyFewPixels(pixelShare),
      ...whyLeft(counts?.left ?? 0),
      ...faultsOf(scenes[0].place.context),
    ],
  };
}

/** Returns the number of splats of a file; the capacity of a generator, whose unusable rows are part of it. */
function totalOf({ gaussians, live }: LoadedGaussians): number {
  const { frameCount, leafCount, count, droppedCount = 0 } = gaussians;
  return (frameCount ?? leafCount ?? count) + (live?.inputs ? 0 : droppedCount);
}

function whyFewPixels(share: number): string[] {
  if (share === 1) return [];
  return [`Splats cover the frame too many times, so each side has ${(100 * share).toPrecision(2)} % of its pixels.`];
}

function whyPreview(isPreview: boolean): string[] {
  return isPreview ? ['A part is shown; the rest is loading.'] : [];
}

function whyDropped(dropped: number): string[] {
  return dropped > 0 ? [`${dropped} splats of the file have values that cannot be drawn.`] : [];
}

function whyDetail(quality: QualityChoice, { splats, pixels }: SceneStats['detail']): string[] {
  // Fixed qualities use levels of detail only if the page sets an allowed error.
  if (splats === 0 || (pixels === 0 && quality !== 'auto')) return [];
  const rest = pixels > 0 ? `the error is at most ${pixels} px` : 'they are drawn only in motion';
  return [`${splats} merged splats replace details that are too small to see: ${rest}.`];
}

function whyLeft(left: number): string[] {
  return left > 0 ? [`${left} splats are not drawn, because the GPU does not allow larger buffers.`] : [];
}

function explainQuality(quality: QualityChoice, { moving, frameMs, targetMs }: DynamicQualityReport): string[] {
  if (quality !== 'auto') return quality === 'default' ? [] : [`The page asks for quality="${quality}".`];
  if (moving === 'whole') return [];
  const found = frameMs === null ? '' : `; the last took ${frameMs.toFixed(1)} ms`;
  return [`Frames in motion are drawn with ${moving}, to stay within ${targetMs.toFixed(1)} ms${found}.`];
}
