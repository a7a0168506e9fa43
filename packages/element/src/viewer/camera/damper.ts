/** Fraction of the scale below which a difference is invisible. The value then snaps to its goal. */
const SETTLED = 2e-5;
/** Fraction of the goal below which float64 loses steps: 2⁻⁵³, times about 10⁵ steps of a slow motion. */
const ROUNDING = 1e-10;

/**
 * Moves a number towards a goal like a critically damped spring: as fast as possible without overshoot.
 *
 * The motion x″ = ω²·(goal − x) − 2ω·x′ is stepped by its exact solution, so the path does not depend on the frame
 * rate: with d = x − goal and k = v + ω·d, after a time t d(t) = (d + k·t)·e^(−ωt) and v(t) = (v − ω·k·t)·e^(−ωt) (any
 * text on the damped harmonic oscillator, for damping ratio 1).
 */
export class Damper {
  #velocity = 0;

  /**
   * Advances one step.
   * @param value Current value, in any unit.
   * @param goal Its goal, in the same unit.
   * @param stepMs Time since the last step in milliseconds, 0 or more.
   * @param decayMs Time constant 1/ω in milliseconds; 0 or less jumps to the goal.
   * @param scale A typical size of the value, which defines the tolerance; above 0.
   * @returns The next value; exactly `goal` once the motion has ended.
   */
  step(value: number, goal: number, stepMs: number, decayMs: number, scale: number): number {
    if (value === goal && this.#velocity === 0) return goal;
    if (!(decayMs > 0)) return this.#rest(goal);
    const frequency = 1 / decayMs;
    const distance = value - goal;
    const slope = this.#velocity + frequency * distance;
    const decay = Math.exp(-frequency * stepMs);
    const nextDistance = (distance + slope * stepMs) * decay;
    this.#velocity = (this.#velocity - frequency * slope * stepMs) * decay;
    // Near a large goal, rounding would lose the last small steps, and the motion would never end.
    const close = Math.max(SETTLED * scale, ROUNDING * Math.abs(goal));
    const settled = Math.abs(nextDistance) < close && Math.abs(this.#velocity) < close * frequency;
    return settled ? this.#rest(goal) : goal + nextDistance;
  }

  /** Resets the velocity to 0. */
  stop(): void {
    this.#velocity = 0;
  }

  #rest(goal: number): number {
    this.#velocity = 0;
    return goal;
  }
}
