import type { Vector3 } from '@gaussian-splat/core';
import { faultsOf } from '@gaussian-splat/renderer/tools';
import type { QualityChoice } from './attributes.js';
import type { DynamicQualityReport } from './controllers/dynamic-quality-controller.js';
import type { SceneState } from './controllers/scene-controller.js';
import type { ElementError } from './errors.js';
import type { LoadedGaussians } from './gpu/loaded-gaussians.js';
import type { ReadCounts } from './gpu/backend.js';

/** Counts of modeled, drawn and visible splats of a scene, its memory, and the reasons for reductions. */
export interface SceneStats {
  /** What draws. */
  readonly renderer: 'webgpu' | 'webgl';
  /** Splats that the file has, or a generator writes at most. */
  readonly modelled: number;
  /** The preview of a scene that is still loading is shown; all counts are those of the preview. */
  readonly isPreview: boolean;
  /** Splats of the file that were left out because a value was not usable. */
  readonly dropped: number;
  /** Splats on the GPU: the current frame of a sequence; the capacity of a streamed scene. */
  readonly splats: number;
  /** Splats on the GPU including levels of detail; the capacity of a streamed scene. */
  readonly inMemory: number;
  /**
   * Levels of detail: merged splats on the GPU besides the scene's own, and the allowed error of frames at rest in
   * pixels. 0 splats for a streamed scene, which contains its own levels.
   */
  readonly detail: { readonly splats: number; readonly pixels: number };
  /**
   * Splats that the last `updateStats()` found drawn: in front of the camera, opaque enough, and covering a pixel. null
   * before.
   */
  readonly drawn: number | null;
  /** Splats that change some pixel by half a step of 255 or more, at the last `updateStats()`. null before. */
  readonly contributed: number | null;
  /** Bytes of GPU memory: of the splats, and of what frames are drawn with. */
  readonly bytes: { readonly scene: number; readonly frames: number };
  /** The attribute `quality`. */
  readonly quality: QualityChoice;
  /** Settings of frames at rest and in motion. */
  readonly dynamicQuality: DynamicQualityReport;
  /**
   * Up direction in the scene's frame according to its file, of length 1; null if the file has none. The first scene
   * counts.
   */
  readonly up: Vector3 | null;
  /**
   * Features of the files that are not drawn or may be drawn differently than intended, in English; also in the
   * console.
   */
  readonly warnings: readonly string[];
  /** The element's own scene, then its children, separately; empty for an element without children. */
  readonly scenes: readonly ChildStats[];
  /** Reductions of the scene to save time or memory, in English; empty without reductions. */
  readonly why: readonly string[];
}

/** State and memory of one child of the element. */
export interface ChildStats {
  /** The child; the element itself for its own scene. */
  readonly element: HTMLElement;
  readonly state: SceneState;
  readonly error: ElementError | null;
  /** Splats on the GPU; of a mesh 0. */
  readonly splats: number;
  /** Triangles; of a scene 0. */
  readonly triangles: number;
  /** Splats of the file that were left out because a value was not usable. */
  readonly dropped: number;
  /** Bytes of GPU memory. */
  readonly bytes: number;
}

/** Memory and counts of a scene. */
export const costOf = (
  scene: LoadedGaussians | null,
): Pick<ChildStats, 'splats' | 'triangles' | 'dropped' | 'bytes'> => ({
  splats: scene ? (scene.gaussians.frameCount ?? scene.gaussians.count) : 0,
  triangles: scene?.model?.triangles ?? 0,
  dropped: scene?.gaussians.droppedCount ?? 0,
  bytes: scene ? scene.gaussians.byteLength + (scene.levels?.byteLength ?? 0) + (scene.model?.byteLength ?? 0) : 0,
});

/** Information that does not come from the scene. */
export interface StatsContext {
  readonly quality: QualityChoice;
  readonly dynamicQuality: DynamicQualityReport;
  readonly counts: ReadCounts | undefined;
  readonly isPreview: boolean;
  /** Bytes of GPU memory that frames are drawn with. */
  readonly frameBytes: number;
  /** See `Painter.pixelShare`. */
  readonly pixelShare?: number | undefined;
  /** Allowed error of images at rest, pixels. */
  readonly pixels: number | undefined;
  readonly parts: readonly ChildStats[];
}

/** Statistics that need no readback from the GPU. */
export function statsOf(
  scenes: readonly LoadedGaussians[],
  { quality, dynamicQuality, counts, isPreview, frameBytes, pixelShare = 1, pixels = 0, parts }: StatsContext,
): SceneStats {
  const sum = (of: (scene: LoadedGaussians) => number | undefined): number =>
    scenes.reduce((total, scene) => total + (of(scene) ?? 0), 0);
  const dropped = sum(({ gaussians }) => gaussians.droppedCount);
  const merged = sum(({ gaussians, levels }) => levels && levels.count - gaussians.count);
  const detail = { splats: merged, pixels };
  return {
    renderer: scenes[0].renderer,
    isPreview,
    splats: sum((scene) => costOf(scene).splats),
    modelled: sum(({ gaussians }) => gaussians.frameCount ?? gaussians.leafCount ?? gaussians.count) + dropped,
    dropped,
    inMemory: sum(({ gaussians }) => gaussians.count) + merged,
    detail,
    drawn: counts?.drawn ?? null,
    contributed: counts?.contributed ?? null,
    bytes: {
      scene:
        sum(({ gaussians }) => gaussians.byteLength) +
        sum(({ levels }) => levels?.byteLength) +
        sum(({ model }) => model?.byteLength),
      frames: frameBytes,
    },
    quality,
    dynamicQuality,
    up: scenes[0]?.bounds.up ?? null,
    warnings: scenes.flatMap(({ warnings }) => warnings),
    scenes: parts,
    why: [
      ...whyPreview(isPreview),
      ...whyDropped(dropped),
      ...whyDetail(quality, detail),
      ...explainQuality(quality, dynamicQuality),
      ...whyFewPixels(pixelShare),
      ...whyLeft(counts?.left ?? 0),
      ...faultsOf(scenes[0].place.context),
    ],
  };
}

function whyFewPixels(share: number): string[] {
  if (share === 1) return [];
  return [`Its splats cover the view too often: each side has ${(100 * share).toPrecision(2)} % of its pixels.`];
}

function whyPreview(isPreview: boolean): string[] {
  return isPreview ? ['A part is shown; the rest is loading.'] : [];
}

function whyDropped(dropped: number): string[] {
  return dropped > 0 ? [`${dropped} splats of the file have values that cannot be drawn.`] : [];
}

function whyDetail(quality: QualityChoice, { splats, pixels }: SceneStats['detail']): string[] {
  // Fixed qualities use them only if the page allows it.
  if (splats === 0 || (pixels === 0 && quality !== 'auto')) return [];
  const rest = pixels > 0 ? `, by ${pixels} px at most` : ' while they move';
  return [`${splats} merged splats stand for what is too small to see: frames may be off for it${rest}.`];
}

function whyLeft(left: number): string[] {
  return left > 0 ? [`${left} splats are not drawn: the GPU allows no buffer that holds more of them.`] : [];
}

function explainQuality(quality: QualityChoice, { moving, frameMs, targetMs }: DynamicQualityReport): string[] {
  if (quality !== 'auto') return quality === 'default' ? [] : [`The page asks for quality="${quality}".`];
  if (moving === 'whole') return [];
  const found = frameMs === null ? '' : `; the last took ${frameMs.toFixed(1)} ms`;
  return [`In motion frames are drawn with ${moving}, to keep to ${targetMs.toFixed(1)} ms${found}.`];
}
