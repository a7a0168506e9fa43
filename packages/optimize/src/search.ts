/** Measured saving and error of a threshold. */
export interface Trade {
  readonly threshold: number;
  /** Mean squared error with the threshold, peak 1. */
  readonly error: number;
  /** Number of values that the file omits because of the threshold. */
  readonly saved: number;
}

/** First point of every curve, without saving and without error. */
const NOTHING: Trade = { threshold: 0, error: 0, saved: 0 };

/** Fractions of the allowed error that are tried for the first of two curves. */
const SHARES = Array.from({ length: 21 }, (_, k) => k / 20);

/** Error as a function of the saving. It is measured at some thresholds, and interpolated between them. */
export class TradeCurve {
  readonly #trades: readonly Trade[];
  readonly #isStepped: boolean;

  /**
   * @param trades Measurements by ascending threshold.
   * @param isStepped Whether the saving between two measurements is that of the first, instead of interpolated.
   */
  constructor(trades: readonly Trade[], isStepped = false) {
    this.#isStepped = isStepped;
    // Errors become monotonic, because noise may make a larger saving seem cheaper.
    let max = 0;
    this.#trades = [NOTHING, ...trades.map((trade) => ({ ...trade, error: (max = Math.max(max, trade.error)) }))];
  }

  /**
   * Returns the trade with the largest saving whose mean squared error is at most `error`. It is interpolated between
   * measurements, unless the saving is stepped.
   */
  within(error: number): Trade {
    const above = this.#trades.findIndex((trade) => trade.error > error);
    if (above === -1) return this.#trades[this.#trades.length - 1];
    const [a, b] = [this.#trades[above - 1], this.#trades[above]];
    // Below the first threshold there is no measurement to interpolate.
    if (above === 1 || this.#isStepped) return a;
    const share = (error - a.error) / (b.error - a.error);
    const threshold = a.threshold * (b.threshold / a.threshold) ** share;
    return { threshold, error, saved: a.saved + share * (b.saved - a.saved) };
  }
}

/**
 * Returns the points of two curves that together save the most within a common error. Among equal savings, the first curve
 * gets the largest fraction of the error.
 */
export function bestTrades(a: TradeCurve, b: TradeCurve, error: number): readonly [Trade, Trade] {
  const choices = SHARES.map((share) => [a.within(share * error), b.within((1 - share) * error)] as const);
  const saved = ([first, second]: readonly [Trade, Trade]): number => first.saved + second.saved;
  return choices.reduce((best, choice) => (saved(choice) >= saved(best) ? choice : best));
}

/** Measures thresholds in ascending order until an error exceeds `maxError`, and returns the curve. */
export async function measureTrades(
  thresholds: readonly number[],
  measure: (threshold: number) => Promise<Trade>,
  maxError: number,
  isStepped = false,
): Promise<TradeCurve> {
  const trades: Trade[] = [];
  for (const threshold of thresholds) {
    trades.push(await measure(threshold));
    if (trades[trades.length - 1].error > maxError) break;
  }
  return new TradeCurve(trades, isStepped);
}
