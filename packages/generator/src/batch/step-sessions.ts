import type { GeneratorSession } from '../runtime/generator-session.js';
import type { SessionKind } from '../runtime/ort-session.js';

/** Number of runs without use after which a session is released. */
const RUNS_UNTIL_RELEASE = 300;

interface Step {
  readonly session: GeneratorSession;
  lastUse: number;
}

/**
 * Returns the number of instances that a session computes for the requested number: the next of 1, 2, 4, 6, 8, 12, 16,
 * 24, 32 ... At most a third of them is unused.
 */
export function stepOf(instances: number): number {
  const whole = 2 ** Math.ceil(Math.log2(instances));
  const between = 0.75 * whole;
  return whole >= 8 && instances <= between ? between : whole;
}

/**
 * Sessions of one model, one for each {@link stepOf} that occurs. Each number of instances needs its own session,
 * because graph capture needs fixed shapes. Adding or removing an instance seldom changes the session.
 */
export class StepSessions {
  /** Maximum number of instances in one run, which the contract and the device's buffers limit. */
  readonly max: number;
  readonly #session: GeneratorSession;
  readonly #steps = new Map<number, Step>();
  #runs = 0;
  #kind: SessionKind | undefined;

  constructor(session: GeneratorSession) {
    this.#session = session;
    const { outputs, contract } = session.model;
    const largest = Math.max(...outputs.map(({ max = 0, dtype }) => max * (dtype === 'float16' ? 2 : 4)));
    const room = Math.floor(session.device.limits.maxBufferSize / largest);
    this.max = Math.max(1, Math.min(contract.instances!.most, room));
  }

  /** Kind of the session of the last run; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return [...this.#steps.values()].sort((a, b) => b.lastUse - a.lastUse)[0]?.session.kind ?? this.#kind;
  }

  /**
   * Returns a session for at least this many instances, at most {@link max}, and the number of instances that it
   * computes.
   */
  sessionFor(instances: number): { readonly session: GeneratorSession; readonly count: number } {
    const count = Math.min(this.max, stepOf(instances));
    let step = this.#steps.get(count);
    if (step === undefined) this.#steps.set(count, (step = { session: this.#session.forInstances(count), lastUse: 0 }));
    step.lastUse = ++this.#runs;
    this.#releaseOld();
    return { session: step.session, count };
  }

  release(): void {
    this.#kind = this.kind;
    for (const { session } of this.#steps.values()) void session.release();
    this.#steps.clear();
  }

  #releaseOld(): void {
    for (const [count, { session, lastUse }] of this.#steps) {
      if (this.#runs - lastUse < RUNS_UNTIL_RELEASE) continue;
      this.#steps.delete(count);
      void session.release();
    }
  }
}
