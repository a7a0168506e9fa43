/** Below this share of the normalising length a difference cannot be seen, and the value snaps to its goal. */
const SETTLED = 2e-5;
/** Share of the goal below which steps get lost in float64: 2⁻⁵³, times the some 10⁵ steps that a slow motion has. */
const ROUNDING = 1e-10;

/**
 * Moves a number towards a goal as a critically damped spring does: as fast as possible without overshoot.
 *
 * The motion x″ = ω²·(goal − x) − 2ω·x′ is stepped by its exact solution, so the path does not depend on the frame
 * rate: with d = x − goal and k = v + ω·d, after a time t d(t) = (d + k·t)·e^(−ωt) and v(t) = (v − ω·k·t)·e^(−ωt)
 * (any text on the damped harmonic oscillator, for damping ratio 1).
 */
export class Damper {
  #velocity = 0;

  /**
   * One step.
   * @param value present value, in any unit.
   * @param goal where it goes, in the same unit.
   * @param stepMs time since the last step in milliseconds, 0 or more.
   * @param decayMs time constant 1/ω in milliseconds; 0 or less jumps to the goal.
   * @param scale a typical size of the value, by which "close enough" is measured; above 0.
   * @returns the next value; exactly `goal` once the motion has ended.
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
    // Next to a large goal the last, tiny steps would be lost in rounding, and the motion would never end.
    const close = Math.max(SETTLED * scale, ROUNDING * Math.abs(goal));
    const settled = Math.abs(nextDistance) < close && Math.abs(this.#velocity) < close * frequency;
    return settled ? this.#rest(goal) : goal + nextDistance;
  }

  /** Forgets the velocity; the next step starts from rest. */
  stop(): void {
    this.#velocity = 0;
  }

  #rest(goal: number): number {
    this.#velocity = 0;
    return goal;
  }
}
