import type { QualityChoice } from './attributes.js';
import type { EconomyReport } from './controllers/economy-controller.js';
import type { PaceReport } from './controllers/pace-controller.js';
import type { GpuScene } from './gpu/gpu-scene.js';

/** What is modelled, drawn, and seen of a scene, what it takes, and why. */
export interface SceneStats {
  /** Splats that the file has, or a generator writes at most. */
  readonly modelled: number;
  /** What is on show is a part of a scene that is still loading; all counts are those of the part. */
  readonly isPreview: boolean;
  /** Of these, left out because a value was not usable. */
  readonly dropped: number;
  /** Of these, left out of all pictures because the attribute `economy` asks for it. */
  readonly spared: number;
  /** dB to the whole scene in views around it that had no say, Infinity where they show no difference; null unless `economy` asks for a figure or for `views`. */
  readonly decibels: number | null;
  /** Splats on the GPU, those of levels of detail included; of a streamed scene those for which there is room. */
  readonly inMemory: number;
  /**
   * Levels of detail: splats that were merged for them and are on the GPU besides the scene's own, and pixels by which pictures at rest may be off. Of a streamed
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
  /** What pictures at rest and in motion are drawn with. */
  readonly pace: PaceReport;
  /** All that is done to the scene for the sake of time or memory, for people; empty where nothing is. */
  readonly why: readonly string[];
}

/** Counts that have to be read back from the GPU. */
export interface ReadCounts {
  readonly drawn: number;
  /** Visible, but without room in what the device allows a buffer to hold. */
  readonly left: number;
  readonly contributed: number;
}

/** What is known besides the scene. */
export interface StatsContext {
  readonly quality: QualityChoice;
  readonly pace: PaceReport;
  readonly counts: ReadCounts | undefined;
  readonly economy: EconomyReport;
  readonly isPreview: boolean;
}

/** Puts together what is known without asking the GPU. */
export function statsOf(scene: GpuScene, { quality, pace, counts, economy, isPreview }: StatsContext): SceneStats {
  const { gaussians } = scene;
  const dropped = gaussians.droppedCount ?? 0;
  const merged = scene.levels === undefined ? 0 : scene.levels.count - gaussians.count;
  const detail = { splats: merged, pixels: scene.detail.detail ?? 0 };
  return {
    isPreview,
    modelled: (gaussians.frameCount ?? gaussians.leafCount ?? gaussians.count) + dropped + economy.spared,
    spared: economy.spared,
    decibels: economy.decibels,
    dropped,
    inMemory: gaussians.count + merged,
    detail,
    drawn: counts?.drawn ?? null,
    contributed: counts?.contributed ?? null,
    bytes: { scene: gaussians.byteLength + (scene.levels?.byteLength ?? 0), frames: scene.frameBytes },
    quality,
    pace,
    why: [
      ...whyPreview(isPreview),
      ...whyDropped(dropped),
      ...whySpared(economy),
      ...whyByView(economy),
      ...whyDetail(quality, detail),
      ...whyPace(quality, pace),
      ...whyLeft(counts?.left ?? 0),
    ],
  };
}

function whyPreview(isPreview: boolean): string[] {
  return isPreview ? ['The scene is still loading; this is a part of it.'] : [];
}

function whyDropped(dropped: number): string[] {
  return dropped > 0 ? [`${dropped} splats of the file have values that cannot be drawn.`] : [];
}

function whySpared({ spared, decibels }: EconomyReport): string[] {
  if (spared === 0) return [];
  return [`${spared} splats that contribute least to views around the scene are left out${figureOf(decibels)}.`];
}

function whyByView({ byView, decibels }: EconomyReport): string[] {
  if (!byView) return [];
  const figure = figureOf(decibels);
  return [
    `Pictures that are drawn with less than the whole leave out splats that do not show from their side${figure}.`,
  ];
}

function figureOf(decibels: number | null): string {
  if (decibels === null) return '';
  return decibels === Infinity ? ', without a trace' : `: ${decibels.toFixed(1)} dB to the whole scene`;
}

function whyDetail(quality: QualityChoice, { splats, pixels }: SceneStats['detail']): string[] {
  // With a chosen quality they are drawn only where the page allows for it.
  if (splats === 0 || (pixels === 0 && quality !== 'auto')) return [];
  const rest = pixels > 0 ? `, by ${pixels} px at most` : ' while they move';
  return [`${splats} merged splats stand for what is too small to see: pictures may be off for it${rest}.`];
}

function whyLeft(left: number): string[] {
  return left > 0 ? [`${left} splats are not drawn: the GPU allows no buffer that holds more of them.`] : [];
}

function whyPace(quality: QualityChoice, { moving, frameMs, targetMs }: PaceReport): string[] {
  if (quality !== 'auto') return quality === 'default' ? [] : [`The page asks for quality="${quality}".`];
  if (moving === 'whole') return [];
  const found = frameMs === null ? '' : `; the last took ${frameMs.toFixed(1)} ms`;
  return [`In motion pictures are drawn with ${moving}, to keep to ${targetMs.toFixed(1)} ms${found}.`];
}
