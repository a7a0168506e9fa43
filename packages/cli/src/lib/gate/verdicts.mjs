/** Verdicts of the gate: whether losses over photographs are below their limits, beyond the chance of the views. */

/** Maximum mean losses over all photographs: PSNR in dB, SSIM and LPIPS. The limits are those of splat-compression-bench. */
export const LIMITS = { psnr: 0.2, ssim: 0.002, lpips: 0.005 };

const RESAMPLES = 2000;

/** Returns a function for repeatable random integers below a bound (a linear congruential generator). */
function seeded(seed) {
  let state = seed;
  return (bound) => {
    state = (Math.imul(state, 1_664_525) + 1_013_904_223) >>> 0;
    return Math.floor((state / 2 ** 32) * bound);
  };
}

/**
 * Returns the standard error of a mean by bootstrap: the standard deviation of the means of samples with replacement.
 * @param values {number[]}
 */
export function standardError(values) {
  const below = seeded(1);
  const means = Array.from({ length: RESAMPLES }, () => {
    let sum = 0;
    for (let k = 0; k < values.length; k++) sum += values[below(values.length)];
    return sum / values.length;
  });
  const mean = means.reduce((sum, value) => sum + value, 0) / RESAMPLES;
  return Math.sqrt(means.reduce((sum, value) => sum + (value - mean) ** 2, 0) / RESAMPLES);
}

/**
 * Returns the mean losses of a file over views, their standard errors, and the verdict: `fails` if a loss is above its
 * limit by more than a standard error, `passes` if all are below by more than that, else `undecided`.
 * @param losses {Record<'psnr' | 'ssim' | 'lpips', number[] | undefined>} Loss in each view; undefined if not measured.
 */
export function verdictOf(losses) {
  const [lost, errors] = [{}, {}];
  const verdicts = Object.entries(LIMITS).map(([key, limit]) => {
    const values = losses[key];
    if (values === undefined) return 'passes';
    lost[key] = values.reduce((sum, value) => sum + value, 0) / values.length;
    errors[key] = standardError(values);
    // A file that loses nothing anywhere has no error.
    if (Math.abs(lost[key] - limit) <= errors[key]) return 'undecided';
    return lost[key] < limit ? 'passes' : 'fails';
  });
  const verdict = ['fails', 'undecided'].find((one) => verdicts.includes(one)) ?? 'passes';
  return { lost, errors, verdict };
}

/**
 * Returns the rows that count: those that pass, and whose encoder passes at all higher targets, too. A single pass
 * among failures is chance.
 * @param rows {{ passes: boolean, encoder?: string, target?: number }[]} Rows without an encoder count if they pass.
 */
export function countedRows(rows) {
  return rows.filter(
    ({ passes, encoder, target }) =>
      passes &&
      (encoder === undefined ||
        rows.every((other) => other.encoder !== encoder || !(other.target > target) || other.passes)),
  );
}
