/** Step sizes of what is rounded. */
export type Steps<K extends string> = Readonly<Record<K, number>>;

export interface AllocateOptions<K extends string> {
  /** Steps to begin with: errors of all of them can be distinguished. */
  readonly usual: Steps<K>;
  /** Numbers of a splat that each step is that of. */
  readonly numbers: Partial<Steps<K>>;
  /** Mean squared error with some steps. */
  readonly measure: (steps: Steps<K>) => Promise<number>;
  /** Mean squared error that all of them may make together. */
  readonly target: number;
}

/** A step is at most so many times as large, or small, as the usual one. */
const FARTHEST = 8;
/** Share of the error that an attribute makes at least, as far as is known. */
const LEAST_SHARE = 1e-3;

/**
 * Steps at which a bit more saves the same error everywhere: the error of an attribute goes with the square of its step, its bits with the logarithm, so that each may make as
 * much of the error as it has numbers. What the usual steps of each make is measured, by doubling them in turn.
 */
export async function allocateSteps<K extends string>(options: AllocateOptions<K>): Promise<Steps<K>> {
  const { usual, numbers, measure, target } = options;
  const begun = await measure(usual);
  const counts = Object.entries(numbers) as [K, number][];
  const all = counts.reduce((sum, [, count]) => sum + count, 0);
  const steps: Record<K, number> = { ...usual };
  for (const [name, count] of counts) {
    const doubled = await measure({ ...usual, [name]: 2 * usual[name] });
    const own = Math.max((doubled - begun) / 3, LEAST_SHARE * begun);
    const factor = Math.sqrt((count * target) / (all * own));
    steps[name] *= Math.min(FARTHEST, Math.max(1 / FARTHEST, factor));
  }
  return steps;
}

export interface FindStepsOptions<
  K extends string,
  Found extends { readonly error: number },
> extends AllocateOptions<K> {
  /** Part of the target that steps are allocated for, if something else makes errors, too; default: all of it. */
  readonly share?: number;
  /** Finds the error of steps, and more, as the result is judged; default: {@link AllocateOptions.measure}. */
  readonly judge?: (steps: Steps<K>) => Promise<Found>;
  /** Part of the target at which the search ends; default 0.97. */
  readonly nearEnough?: number;
}

/**
 * Finds the coarsest steps within an error: {@link allocateSteps} balances them, {@link fitSteps} scales all of them.
 * @returns the steps, and what `judge` found with them
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

/** What steps times a factor came to. */
interface Tried {
  readonly scale: number;
  readonly error: number;
}

export interface FitStepsOptions<K extends string, Found extends { readonly error: number }> {
  readonly steps: Steps<K>;
  /** What is found with some steps, a mean squared error above all. */
  readonly measure: (steps: Steps<K>) => Promise<Found>;
  /** Mean squared error that is allowed. */
  readonly target: number;
  /** Measurements at most; default 6. */
  readonly tries?: number;
  /** Part of the target that is near enough to end with; default 0.97. */
  readonly nearEnough?: number | undefined;
}

/**
 * The same steps, times the factor with which they err as much as is allowed, or nearly.
 * @returns the steps, and what was found with them; the finest that were tried where all err too much
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

/** How many times as large, or small, as the one before a scale is at most. */
const FARTHEST_SCALE = 3;
/** Errors go with the square of the scale as a rule; where two tries tell that they grow more slowly, with this power of it at least. */
const LEAST_SLOPE = 0.5;

/** A scale between tries above and below the figure, or beyond those that are all on one side of it. */
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
    const factor = (aim / error) ** (1 / Math.min(2, Math.max(LEAST_SLOPE, slope || 2)));
    return scale * Math.min(FARTHEST_SCALE, Math.max(1 / FARTHEST_SCALE, factor));
  }
  const share = Math.log(aim / below.error) / Math.log(above.error / below.error);
  return below.scale * (above.scale / below.scale) ** Math.min(0.9, Math.max(0.1, share));
}
