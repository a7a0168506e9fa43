/** What a threshold takes away, and what that costs. */
export interface Trade {
  readonly threshold: number;
  /** Mean squared error, peak 1. */
  readonly error: number;
  /** Numbers of the file that go. */
  readonly saved: number;
}

/** Nothing taken, nothing lost: where every curve begins. */
const NOTHING: Trade = { threshold: 0, error: 0, saved: 0 };

/** Shares of the error that are tried for the first of two curves. */
const SHARES = Array.from({ length: 21 }, (_, k) => k / 20);

/** How the error grows with what goes: measured at some thresholds, and told between them. */
export class TradeCurve {
  readonly #trades: readonly Trade[];
  readonly #isStepped: boolean;

  /**
   * @param trades by ascending threshold
   * @param isStepped if nothing is saved between two of them but what the first saves
   */
  constructor(trades: readonly Trade[], isStepped = false) {
    this.#isStepped = isStepped;
    // Noise must not make more cost less.
    let most = 0;
    this.#trades = [NOTHING, ...trades.map((trade) => ({ ...trade, error: (most = Math.max(most, trade.error)) }))];
  }

  /** As much as an error allows. */
  within(error: number): Trade {
    const above = this.#trades.findIndex((trade) => trade.error > error);
    if (above === -1) return this.#trades[this.#trades.length - 1];
    const [a, b] = [this.#trades[above - 1], this.#trades[above]];
    // Below the first measured threshold nothing is known.
    if (above === 1 || this.#isStepped) return a;
    const share = (error - a.error) / (b.error - a.error);
    const threshold = a.threshold * (b.threshold / a.threshold) ** share;
    return { threshold, error, saved: a.saved + share * (b.saved - a.saved) };
  }
}

/** The two trades that save most within an error that they share; of those that save as much, the one with most of it for the first. */
export function bestTrades(a: TradeCurve, b: TradeCurve, error: number): readonly [Trade, Trade] {
  const choices = SHARES.map((share) => [a.within(share * error), b.within((1 - share) * error)] as const);
  const saved = ([first, second]: readonly [Trade, Trade]): number => first.saved + second.saved;
  return choices.reduce((best, choice) => (saved(choice) >= saved(best) ? choice : best));
}

/** Measures at thresholds, from the least to the largest, until the error is larger than any that matters. */
export async function measureTrades(
  thresholds: readonly number[],
  measure: (threshold: number) => Promise<Trade>,
  mostError: number,
  isStepped = false,
): Promise<TradeCurve> {
  const trades: Trade[] = [];
  for (const threshold of thresholds) {
    trades.push(await measure(threshold));
    if (trades[trades.length - 1].error > mostError) break;
  }
  return new TradeCurve(trades, isStepped);
}
