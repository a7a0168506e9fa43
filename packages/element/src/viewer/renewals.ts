/**
 * Maximum number of loads of a scene in {@link PERIOD_MS} because its file was replaced. Servers that do not share their
 * files may alternate between versions.
 */
const MAX_RENEWALS = 3;
const PERIOD_MS = 60_000;

/** Limits how often a scene is loaded again because its file was replaced on its server. */
export class Renewals {
  #times: number[] = [];
  /** Whether a scene is being loaded again. */
  isRunning = false;

  /**
   * Loads a scene again, unless that is happening already.
   * @param error Reason of the call, which is thrown if the limit is reached.
   */
  async run(error: unknown, load: () => Promise<void>): Promise<void> {
    if (this.isRunning) return;
    const now = performance.now();
    this.#times = this.#times.filter((time) => now - time < PERIOD_MS);
    if (this.#times.length >= MAX_RENEWALS) throw error;
    this.#times.push(now);
    this.isRunning = true;
    await load().finally(() => (this.isRunning = false));
  }
}
