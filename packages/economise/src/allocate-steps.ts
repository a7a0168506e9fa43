/** What is rounded, each by its own step, and how many numbers of a splat have that step. */
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

/** The same steps, times a factor. */
export const scaledSteps = <K extends string>(steps: Steps<K>, factor: number): Steps<K> =>
  Object.fromEntries(Object.entries<number>(steps).map(([name, step]) => [name, step * factor])) as Steps<K>;
