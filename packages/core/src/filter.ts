/**
 * The screen-space low-pass filter that a scene was trained with: `classic` adds 0.3 px² to the variance of each splat, `antialiased` compensates its opacity for that, too (gsplat's and
 * INRIA's options of that name), and `mip` adds 0.1 px² and compensates (Mip-Splatting, Brush's mip mode).
 */
export type SplatFilter = 'classic' | 'antialiased' | 'mip';

/** A filter in numbers. */
export interface FilterRule {
  /** Whether opacities are compensated for what is added. */
  readonly antialiased: boolean;
  /** Variance in px² that is added; undefined is the classic 0.3. */
  readonly filterVariance?: number | undefined;
}

export const SPLAT_FILTERS: Readonly<Record<SplatFilter, FilterRule>> = {
  classic: { antialiased: false, filterVariance: undefined },
  antialiased: { antialiased: true, filterVariance: undefined },
  mip: { antialiased: true, filterVariance: 0.1 },
};
