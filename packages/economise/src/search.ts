/** Saving of a threshold, and its cost. */
export interface Trade {
  readonly threshold: number;
  /** Mean squared error, peak 1. */
  readonly error: number;
  /** Numbers of the file that are saved. */
  readonly saved: number;
}

/** No saving and no error: the start of every curve. */
const NOTHING: Trade = { threshold: 0, error: 0, saved: 0 };

/** Fractions of the error that are tried for the first of two curves. */
const SHARES = Array.from({ length: 21 }, (_, k) => k / 20);

/** Error as a function of the saving: measured at some thresholds, interpolated between them. */
export class TradeCurve {
  readonly #trades: readonly Trade[];
  readonly #isStepped: boolean;

  /**
   * @param trades By ascending threshold.
   * @param isStepped Whether the saving between two of them is that of the first.
   */
  constructor(trades: readonly Trade[], isStepped = false) {
    this.#isStepped = isStepped;
    // Noise must not make a larger saving cheaper.
    let max = 0;
    this.#trades = [NOTHING, ...trades.map((trade) => ({ ...trade, error: (max = Math.max(max, trade.error)) }))];
  }

  /** The largest saving within an error. */
  within(error: number): Trade {
    const above = this.#trades.findIndex((trade) => trade.error > error);
    if (above === -1) return this.#trades[this.#trades.length - 1];
    const [a, b] = [this.#trades[above - 1], this.#trades[above]];
    // Nothing is measured below the first threshold.
    if (above === 1 || this.#isStepped) return a;
    const share = (error - a.error) / (b.error - a.error);
    const threshold = a.threshold * (b.threshold / a.threshold) ** share;
    return { threshold, error, saved: a.saved + share * (b.saved - a.saved) };
  }
}

/** The two trades that save the most within a common error; among equals, the one with the most of it for the first. */
export function bestTrades(a: TradeCurve, b: TradeCurve, error: number): readonly [Trade, Trade] {
  const choices = SHARES.map((share) => [a.within(share * error), b.within((1 - share) * error)] as const);
  const saved = ([first, second]: readonly [Trade, Trade]): number => first.saved + second.saved;
  return choices.reduce((best, choice) => (saved(choice) >= saved(best) ? choice : best));
}

/** Measures ascending thresholds until the error exceeds the relevant range. */
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
