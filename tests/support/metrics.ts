/** Differences between two images. Values are numbers around 0..1, three channels to a pixel by default. */

export interface ComparisonOptions {
  /** [pixels] compare only pixels at which this is not 0, for example those that any splat covers. Default: all. */
  readonly mask?: ArrayLike<number>;
  /** Clamp both images to 0..1 first, as an 8-bit image must. Default false. */
  readonly clamp?: boolean;
  /** Numbers to a pixel. Default 3. */
  readonly channels?: number;
}

/**
 * Absolute difference of every compared channel. A value that is not finite counts as infinitely wrong, so that no NaN
 * slips through a comparison. Throws if the images differ in size or nothing is left to compare.
 */
export function differences(a: ArrayLike<number>, b: ArrayLike<number>, options: ComparisonOptions = {}): Float64Array {
  const { mask, clamp = false, channels = 3 } = options;
  if (a.length !== b.length) throw new RangeError(`images of ${a.length} and ${b.length} numbers cannot be compared`);
  if (mask && mask.length * channels !== a.length) {
    throw new RangeError(`a mask of ${mask.length} pixels does not fit ${a.length} numbers, ${channels} to a pixel`);
  }
  const shown = (value: number): number => (clamp ? Math.min(1, Math.max(0, value)) : value);
  const out = new Float64Array(a.length);
  let kept = 0;
  for (let i = 0; i < a.length; i++) {
    if (mask && !mask[Math.floor(i / channels)]) continue;
    const difference = Number.isFinite(a[i]) && Number.isFinite(b[i]) ? Math.abs(shown(a[i]) - shown(b[i])) : Infinity;
    out[kept++] = difference;
  }
  if (kept === 0) throw new RangeError('no pixel to compare: the mask is empty');
  return out.subarray(0, kept);
}

/** Peak signal-to-noise ratio in dB, peak 1: 10·log10(1 / mean squared difference); Infinity for equal images. */
export function psnr(a: ArrayLike<number>, b: ArrayLike<number>, options?: ComparisonOptions): number {
  const d = differences(a, b, options);
  return -10 * Math.log10(d.reduce((sum, x) => sum + x * x, 0) / d.length);
}

/** Largest absolute difference of any channel. */
export function maxAbs(a: ArrayLike<number>, b: ArrayLike<number>, options?: ComparisonOptions): number {
  return differences(a, b, options).reduce((max, x) => Math.max(max, x), 0);
}

/** The absolute difference that the given fraction of channels (0..1, for example 0.999) does not exceed. */
export function percentile(
  a: ArrayLike<number>,
  b: ArrayLike<number>,
  share: number,
  options?: ComparisonOptions,
): number {
  const sorted = differences(a, b, options).sort();
  return sorted[Math.min(sorted.length - 1, Math.max(0, Math.ceil(share * sorted.length) - 1))];
}

/** Fraction of channels (0..1) whose absolute difference is above a limit. */
export function shareAbove(
  a: ArrayLike<number>,
  b: ArrayLike<number>,
  limit: number,
  options?: ComparisonOptions,
): number {
  const d = differences(a, b, options);
  return d.reduce((count, x) => count + (x > limit ? 1 : 0), 0) / d.length;
}
