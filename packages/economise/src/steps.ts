/** Quantization step sizes. */
export type Steps<K extends string> = Readonly<Record<K, number>>;

export interface AllocateOptions<K extends string> {
  /** Initial steps: large enough that the errors of all are distinguishable. */
  readonly usual: Steps<K>;
  /** Numbers of a splat for each step. */
  readonly numbers: Partial<Steps<K>>;
  /** Mean squared error with some steps. */
  readonly measure: (steps: Steps<K>) => Promise<number>;
  /** Allowed total mean squared error. */
  readonly target: number;
}

/** Maximum ratio between a step and the usual one. */
const FARTHEST = 8;
/** Minimum fraction of the error of an attribute. */
const MIN_SHARE = 1e-3;

/**
 * Finds steps such that an additional bit saves the same error in every attribute: the error of an attribute grows with
 * the square of its step, its bits with the logarithm, so each may have a fraction of the error in proportion to its
 * numbers. The error of each usual step is measured by doubling it.
 */
export async function allocateSteps<K extends string>(options: AllocateOptions<K>): Promise<Steps<K>> {
  const { usual, numbers, measure, target } = options;
  const begun = await measure(usual);
  const counts = Object.entries(numbers) as [K, number][];
  const all = counts.reduce((sum, [, count]) => sum + count, 0);
  const steps: Record<K, number> = { ...usual };
  for (const [name, count] of counts) {
    const doubled = await measure({ ...usual, [name]: 2 * usual[name] });
    const own = Math.max((doubled - begun) / 3, MIN_SHARE * begun);
    const factor = Math.sqrt((count * target) / (all * own));
    steps[name] *= Math.min(FARTHEST, Math.max(1 / FARTHEST, factor));
  }
  return steps;
}

export interface FindStepsOptions<
  K extends string,
  Found extends { readonly error: number },
> extends AllocateOptions<K> {
  /** Fraction of the target for the steps, if there are other sources of error; default: all of it. */
  readonly share?: number;
  /**
   * Measures the error of steps, and more, under the conditions of the result; default: {@link
   * AllocateOptions.measure}.
   */
  readonly judge?: (steps: Steps<K>) => Promise<Found>;
  /** The search ends at this fraction of the target; default 0.97. */
  readonly nearEnough?: number;
}

/**
 * Finds the coarsest steps within an error: {@link allocateSteps} balances them, {@link fitSteps} scales all of them.
 * @returns The steps, and the result of `judge` for them.
 */
export async function findSteps<K extends string, Found extends { readonly error: number }>(
  options: FindStepsOptions<K, Found>,
): Promise<Found & { readonly steps: Steps<K> }> {
  const { measure, target, share = target, nearEnough } = options;
  const judge = options.judge ?? (async (steps) => ({ error: await measure(steps) }) as Found);
  return fitSteps({ steps: await allocateSteps({ ...options, target: share }), measure: judge, target, nearEnough });
}

/** The same steps, times a factor. */
export const scaledSteps = <K extends string>(steps: Steps<K>, factor: number): Steps<K> =>
  Object.fromEntries(Object.entries<number>(steps).map(([name, step]) => [name, step * factor])) as Steps<K>;

/** Result of a scale factor. */
interface Tried {
  readonly scale: number;
  readonly error: number;
}

export interface FitStepsOptions<K extends string, Found extends { readonly error: number }> {
  readonly steps: Steps<K>;
  /** Measures some steps; the result contains a mean squared error. */
  readonly measure: (steps: Steps<K>) => Promise<Found>;
  /** Allowed mean squared error. */
  readonly target: number;
  /** Maximum number of measurements; default 6. */
  readonly tries?: number;
  /** The search ends at this fraction of the target; default 0.97. */
  readonly nearEnough?: number | undefined;
}

/**
 * Scales steps so that their error is near the allowed one.
 * @returns The steps, and the measurement; the finest tried steps if all exceed the limit.
 */
export async function fitSteps<K extends string, Found extends { readonly error: number }>(
  options: FitStepsOptions<K, Found>,
): Promise<Found & { readonly steps: Steps<K> }> {
  const { steps, measure, target, tries = 6, nearEnough = 0.97 } = options;
  const aim = ((1 + nearEnough) / 2) * target;
  const tried: (Found & { readonly scale: number; readonly steps: Steps<K> })[] = [];
  for (let scale = 1; tried.length < tries; scale = nextScale(tried, aim)) {
    const own = scaledSteps(steps, scale);
    tried.push({ ...(await measure(own)), scale, steps: own });
    const { error } = tried[tried.length - 1];
    if (error <= target && error >= nearEnough * target) break;
  }
  tried.sort((a, b) => a.error - b.error);
  return tried.findLast(({ error }) => error <= target) ?? tried[0];
}

/** Maximum ratio between two consecutive scales. */
const FARTHEST_SCALE = 3;
/**
 * Lower limit of the exponent of the error as a function of the scale, which is usually 2, but may be lower between two
 * tries.
 */
const MIN_SLOPE = 0.5;

/** A scale between tries above and below the target, or beyond those that are all on one side of it. */
function nextScale(tried: readonly Tried[], aim: number): number {
  const [below, above] = tried.reduce<readonly [Tried?, Tried?]>(
    ([low, high], one) =>
      one.error <= aim
        ? [low && low.error > one.error ? low : one, high]
        : [low, high && high.error < one.error ? high : one],
    [undefined, undefined],
  );
  if (below === undefined || above === undefined || above.scale <= below.scale) {
    const [before, last] = tried.slice(-2);
    const { scale, error } = last ?? before;
    const slope = last ? Math.log(error / before.error) / Math.log(scale / before.scale) : 2;
    const factor = (aim / error) ** (1 / Math.min(2, Math.max(MIN_SLOPE, slope || 2)));
    return scale * Math.min(FARTHEST_SCALE, Math.max(1 / FARTHEST_SCALE, factor));
  }
  const share = Math.log(aim / below.error) / Math.log(above.error / below.error);
  return below.scale * (above.scale / below.scale) ** Math.min(0.9, Math.max(0.1, share));
}
