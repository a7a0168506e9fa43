import type { GeneratorSession } from '../runtime/generator-session.js';
import type { SessionKind } from '../runtime/ort-session.js';

/** Number of runs after which an unused session for a number of instances is released. */
const RUNS_UNTIL_RELEASE = 300;

interface Step {
  readonly session: GeneratorSession;
  lastUse: number;
}

/**
 * Number of instances that a session computes: 1, 2, 4, 6, 8, 12, 16, 24, 32 ... The excess, at most a third, is
 * wasted.
 */
export function stepOf(instances: number): number {
  const whole = 2 ** Math.ceil(Math.log2(instances));
  const between = 0.75 * whole;
  return whole >= 8 && instances <= between ? between : whole;
}

/**
 * Sessions of one model, one for each {@link stepOf} the instances. Graph capture needs fixed shapes, so each step has
 * its own session; adding or removing an instance mostly stays within a step.
 */
export class StepSessions {
  /** Maximum number of instances in one run: limited by the contract and the device's buffers. */
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

  /** Session kind of the last run; undefined before. */
  get kind(): SessionKind | undefined {
    return [...this.#steps.values()].sort((a, b) => b.lastUse - a.lastUse)[0]?.session.kind ?? this.#kind;
  }

  /** Returns the session for at least this many instances, and the number that it computes. */
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
