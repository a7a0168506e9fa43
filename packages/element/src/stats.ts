import type { QualityChoice } from './attributes.js';
import type { PaceReport } from './controllers/pace-controller.js';
import type { GpuScene } from './gpu/gpu-scene.js';

/** What is modelled, drawn, and seen of a scene, what it takes, and why. */
export interface SceneStats {
  /** Splats that the file has, or a generator writes at most. */
  readonly modelled: number;
  /** Of these, left out because a value was not usable. */
  readonly dropped: number;
  /** Splats on the GPU. */
  readonly inMemory: number;
  /** Splats that were drawn, as of the last `updateStats()`: in front of the camera, opaque enough, and over a pixel. null before. */
  readonly drawn: number | null;
  /** Splats that some pixel shows by half a step of 255 or more, likewise. */
  readonly contributed: number | null;
  /** Bytes of GPU memory: of the splats, and of what frames are drawn with. */
  readonly bytes: { readonly scene: number; readonly frames: number };
  /** The attribute `quality`. */
  readonly quality: QualityChoice;
  /** What pictures at rest and in motion are drawn with. */
  readonly pace: PaceReport;
  /** All that is done to the scene for the sake of time or memory, for people; empty where nothing is. */
  readonly why: readonly string[];
}

/** Counts that have to be read back from the GPU. */
export interface ReadCounts {
  readonly drawn: number;
  readonly contributed: number;
}

/** Puts together what is known without asking the GPU. */
export function statsOf(
  scene: GpuScene,
  quality: QualityChoice,
  pace: PaceReport,
  counts: ReadCounts | undefined,
): SceneStats {
  const { gaussians } = scene;
  const dropped = gaussians.droppedCount ?? 0;
  return {
    modelled: gaussians.count + dropped,
    dropped,
    inMemory: gaussians.count,
    drawn: counts?.drawn ?? null,
    contributed: counts?.contributed ?? null,
    bytes: { scene: gaussians.byteLength, frames: scene.frameBytes },
    quality,
    pace,
    why: [...whyDropped(dropped), ...whyPace(quality, pace)],
  };
}

function whyDropped(dropped: number): string[] {
  return dropped > 0 ? [`${dropped} splats of the file have values that cannot be drawn.`] : [];
}

function whyPace(quality: QualityChoice, { moving, frameMs, targetMs }: PaceReport): string[] {
  if (quality !== 'auto') return quality === 'default' ? [] : [`The page asks for quality="${quality}".`];
  if (moving === 'whole') return [];
  const found = frameMs === null ? '' : `; frames take ${frameMs.toFixed(1)} ms now`;
  return [`In motion pictures are drawn with ${moving}, to keep to ${targetMs.toFixed(1)} ms${found}.`];
}
