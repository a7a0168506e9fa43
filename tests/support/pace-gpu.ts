/** Simulated GPUs for dynamic quality, and measures of the chosen levels. */
import { type QualityLevel, nextQuality, quantile, INITIAL_QUALITY, type QualityState } from './element/quality.js';
import { randomSource } from './gpu.js';

/** Levels that do not change with the element's. */
export const LEVELS: readonly QualityLevel[] = [
  { name: 'whole', settings: undefined, scale: 1 },
  ...[1, 1, 0.84, 0.71, 0.59, 0.5, 0.42, 0.35, 0.25].map((scale, i) => ({
    name: `level ${i + 1}`,
    settings: { resolutionScale: scale },
    scale,
  })),
];

/** Default costs of a simulated GPU's levels, as fractions of the full image: all of the cost scales with pixels. */
export const COSTS = LEVELS.map(({ scale }, level) => [1, 0.73][level] ?? 0.72 * scale ** 2);

export interface Gpu {
  /** Frames per second of the display. */
  readonly hertz: number;
  /** Time of the full image in ms, as a multiple of the target. */
  readonly load: (now: number) => number;
  /** Fraction of a frame that no level makes cheaper. */
  readonly fixed: number;
  /** Cost of each level as a fraction of the first; COSTS by default. */
  readonly shares?: (now: number) => readonly number[];
  /** Relative spread of times; and how many frames in a hundred take three times as long. */
  readonly noise: number;
  readonly spikes: number;
  /** Frames until a time is known. */
  readonly latency: number;
  /** Whether the camera moves at a time; always by default. */
  readonly moves?: (now: number) => boolean;
  readonly seed: number;
}

export interface Frame {
  readonly at: number;
  readonly level: number;
  /** As a fraction of the target. */
  readonly share: number;
}

/**
 * Draws frames in motion for the given time: a frame starts with a display refresh, once the GPU has at most one frame
 * queued.
 */
export function run(
  gpu: Gpu,
  milliseconds: number,
  levels = LEVELS,
): { frames: Frame[]; quality: QualityState; targetMs: number } {
  const interval = 1000 / gpu.hertz;
  const targetMs = 0.8 * interval;
  const random = randomSource(gpu.seed);
  const frames: Frame[] = [];
  const waiting: { due: number; at: number; level: number; spent: number }[] = [];
  let quality = INITIAL_QUALITY;
  let free = 0;
  for (let at = 0; at < milliseconds; at += interval) {
    while (waiting.length > 0 && waiting[0].due <= at) {
      const { due, level, spent } = waiting.shift()!;
      quality = nextQuality(quality, { now: due, level, milliseconds: spent }, { targetMs, levels });
    }
    if (gpu.moves?.(at) === false || free > at + interval) continue;
    const { level } = quality;
    const whole = gpu.load(at) * (gpu.fixed + (1 - gpu.fixed) * (gpu.shares?.(at) ?? COSTS)[level]);
    const spread = 1 + gpu.noise * (random() + random() + random() - 1.5);
    const share = whole * spread * (random() < gpu.spikes / 100 ? 3 : 1);
    const spent = share * targetMs;
    free = Math.max(at, free) + spent;
    frames.push({ at, level, share });
    waiting.push({ due: free + gpu.latency * interval, at, level, spent });
  }
  return { frames, quality: quality, targetMs };
}

/** Changes of direction of the level between two times. */
export function reversals(frames: readonly Frame[], from: number, to: number): number {
  const levels = frames.filter(({ at }) => at >= from && at < to).map(({ level }) => level);
  const steps = levels
    .slice(1)
    .map((level, i) => Math.sign(level - levels[i]))
    .filter((step) => step !== 0);
  return steps.slice(1).filter((step, i) => step !== steps[i]).length;
}

export const p95 = (frames: readonly Frame[], from: number, to: number): number =>
  quantile(
    frames.filter(({ at }) => at >= from && at < to).map(({ share }) => share),
    0.95,
  );

/** Windows of five seconds with more than one change of direction, of those that begin with a frame. */
export function restlessWindows(frames: readonly Frame[]): number {
  let turned = 0;
  const turns: number[] = [];
  frames.forEach(({ at, level }, i) => {
    const step = i === 0 ? 0 : Math.sign(level - frames[i - 1].level);
    if (step === 0) return;
    if (turned !== 0 && step !== turned) turns.push(at);
    turned = step;
  });
  return turns.slice(1).filter((at, i) => at - turns[i] < 5_000).length;
}
