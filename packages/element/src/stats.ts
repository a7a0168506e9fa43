import type { Vector3 } from '@gaussian-splat/core';
import { faultsOf } from '@gaussian-splat/renderer/tools';
import type { QualityChoice } from './attributes.js';
import type { DynamicQualityReport } from './controllers/dynamic-quality-controller.js';
import type { SceneState } from './controllers/scene-controller.js';
import type { ElementError } from './errors.js';
import type { LoadedGaussians } from './gpu/loaded-gaussians.js';
import type { ReadCounts } from './gpu/painter.js';

/** What is modelled, drawn, and seen of a scene, what it takes, and why. */
export interface SceneStats {
  /** What draws. */
  readonly renderer: 'webgpu' | 'webgl';
  /** Splats that the file has, or a generator writes at most. */
  readonly modelled: number;
  /** What is shown is a part of a scene that is still loading; all counts are those of the part. */
  readonly isPreview: boolean;
  /** Of these, left out because a value was not usable. */
  readonly dropped: number;
  /** Splats on the GPU; of a sequence those of its present frame, of a streamed scene those for which there is room. */
  readonly splats: number;
  /** Splats on the GPU, those of levels of detail included; of a streamed scene those for which there is room. */
  readonly inMemory: number;
  /**
   * Levels of detail: splats that were merged for them and are on the GPU besides the scene's own, and pixels by which frames at rest may be off. Of a streamed
   * scene, whose levels are its own, 0 splats.
   */
  readonly detail: { readonly splats: number; readonly pixels: number };
  /** Splats that were drawn, as of the last `updateStats()`: in front of the camera, opaque enough, and over a pixel. null before. */
  readonly drawn: number | null;
  /** Splats that some pixel shows by half a step of 255 or more, likewise. */
  readonly contributed: number | null;
  /** Bytes of GPU memory: of the splats, and of what frames are drawn with. */
  readonly bytes: { readonly scene: number; readonly frames: number };
  /** The attribute `quality`. */
  readonly quality: QualityChoice;
  /** What frames at rest and in motion are drawn with. */
  readonly dynamicQuality: DynamicQualityReport;
  /** The direction of the scene's frame that its file says points up, of length 1; null where it says nothing. Of several scenes that of the first. */
  readonly up: Vector3 | null;
  /** What of the files is not drawn, or may mean something else than what is drawn, for readers; the console has it, too. */
  readonly warnings: readonly string[];
  /** The element's own scene, then its children, each by itself; empty for an element without children. */
  readonly scenes: readonly PartStats[];
  /** All that is done to the scene for the sake of time or memory, for readers; empty where nothing is. */
  readonly why: readonly string[];
}

/** What a child of the element shows, and what it takes. */
export interface PartStats {
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

/** What a scene takes. */
export const costOf = (
  scene: LoadedGaussians | null,
): Pick<PartStats, 'splats' | 'triangles' | 'dropped' | 'bytes'> => ({
  splats: scene ? (scene.gaussians.frameCount ?? scene.gaussians.count) : 0,
  triangles: scene?.model?.triangles ?? 0,
  dropped: scene?.gaussians.droppedCount ?? 0,
  bytes: scene ? scene.gaussians.byteLength + (scene.levels?.byteLength ?? 0) + (scene.model?.byteLength ?? 0) : 0,
});

/** What is known besides the scene. */
export interface StatsContext {
  readonly quality: QualityChoice;
  readonly dynamicQuality: DynamicQualityReport;
  readonly counts: ReadCounts | undefined;
  readonly isPreview: boolean;
  /** Bytes of GPU memory that frames are drawn with. */
  readonly frameBytes: number;
  /** See `Painter.pixelShare`. */
  readonly pixelShare?: number | undefined;
  /** Pixels by which pictures at rest may be off. */
  readonly pixels: number | undefined;
  readonly parts: readonly PartStats[];
}

/** Puts together what is known without asking the GPU. */
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
  // With a chosen quality they are drawn only where the page allows for it.
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
