/** Quantization step of each attribute. */
export type Steps<K extends string> = Readonly<Record<K, number>>;

export interface AllocateOptions<K extends string> {
  /** Initial steps, which must be so large that the error of each step is measurable. */
  readonly usual: Steps<K>;
  /** Count of a splat's numbers that each step quantizes. */
  readonly numbers: Partial<Steps<K>>;
  /** Returns the mean squared error with some steps. */
  readonly measure: (steps: Steps<K>) => Promise<number>;
  /** Allowed total mean squared error. */
  readonly target: number;
}

/** Maximum ratio between a found step and the initial step, in both directions. */
const FARTHEST = 8;
/** Minimum error of an attribute, as a fraction of the error with the initial steps. */
const MIN_SHARE = 1e-3;

/**
 * Finds steps with which an additional bit saves the same error in every attribute. The error of an attribute is
 * proportional to the square of its step, and its bits to the logarithm. Therefore the error of each attribute is
 * proportional to its count of numbers. The error of each initial step is measured by doubling the step.
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
  /** Allowed mean squared error of the steps alone, if there are other sources of error; default `target`. */
  readonly share?: number;
  /**
   * Measures steps under the conditions of the result. Its value has the mean squared error, and may have more properties.
   * Default: {@link AllocateOptions.measure}.
   */
  readonly judge?: (steps: Steps<K>) => Promise<Found>;
  /** Fraction of the target that ends the search; default 0.97. */
  readonly nearEnough?: number;
}

/**
 * Finds the coarsest steps within an error. {@link allocateSteps} balances the steps, and {@link fitSteps} scales all of
 * them.
 * @returns The steps, and the properties that `judge` has returned for them.
 */
export async function findSteps<K extends string, Found extends { readonly error: number }>(
  options: FindStepsOptions<K, Found>,
): Promise<Found & { readonly steps: Steps<K> }> {
  const { measure, target, share = target, nearEnough } = options;
  const judge = options.judge ?? (async (steps) => ({ error: await measure(steps) }) as Found);
  return fitSteps({ steps: await allocateSteps({ ...options, target: share }), measure: judge, target, nearEnough });
}

/** Returns steps multiplied by a factor. */
export const scaledSteps = <K extends string>(steps: Steps<K>, factor: number): Steps<K> =>
  Object.fromEntries(Object.entries<number>(steps).map(([name, step]) => [name, step * factor])) as Steps<K>;

/** Measured mean squared error of steps multiplied by a scale factor. */
interface Tried {
  readonly scale: number;
  readonly error: number;
}

export interface FitStepsOptions<K extends string, Found extends { readonly error: number }> {
  readonly steps: Steps<K>;
  /** Measures steps. Its result has the mean squared error, and may have more properties. */
  readonly measure: (steps: Steps<K>) => Promise<Found>;
  /** Allowed mean squared error. */
  readonly target: number;
  /** Maximum number of measurements; default 6. */
  readonly tries?: number;
  /** Fraction of the target that ends the search; default 0.97. */
  readonly nearEnough?: number | undefined;
}

/**
 * Scales steps so that their error is within the target, and near to it.
 * @returns The steps, and their measurement. The steps with the smallest error if all exceed the target.
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

/** Maximum ratio between consecutive scale factors. */
const FARTHEST_SCALE = 3;
/**
 * Minimum exponent of the error as a function of the scale. The exponent is about 2, but may be lower between two
 * measurements.
 */
const MIN_SLOPE = 0.5;

/**
 * Returns the next scale factor: between tried scales with errors above and below `aim`, or extrapolated if all errors are
 * on one side.
 */
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
