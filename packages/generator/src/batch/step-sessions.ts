import type { GeneratorSession } from '../runtime/generator-session.js';
import type { SessionKind } from '../runtime/live-session.js';

/** Runs after which the session of a number of instances that has not been needed since is let go. */
const RUNS_UNTIL_RELEASE = 300;

interface Step {
  readonly session: GeneratorSession;
  lastUse: number;
}

/**
 * Instances that a session for so many computes: 1, 2, 4, 6, 8, 12, 16, 24, 32 ... Those beyond what was asked for are computed in vain, a third
 * of them at most.
 */
export function stepOf(instances: number): number {
  const whole = 2 ** Math.ceil(Math.log2(instances));
  const between = 0.75 * whole;
  return whole >= 8 && instances <= between ? between : whole;
}

/**
 * Sessions of one model, one for each {@link stepOf} the instances. Recorded commands have fixed shapes, so there is one for each step; an instance
 * that comes or goes mostly stays within it.
 */
export class StepSessions {
  /** Most instances of one run: what the contract and the device's buffers allow. */
  readonly most: number;
  readonly #session: GeneratorSession;
  readonly #steps = new Map<number, Step>();
  #runs = 0;
  #kind: SessionKind | undefined;

  constructor(session: GeneratorSession) {
    this.#session = session;
    const { outputs, contract } = session.model;
    const largest = Math.max(...outputs.map(({ most = 0, dtype }) => most * (dtype === 'float16' ? 2 : 4)));
    const room = Math.floor(session.device.limits.maxBufferSize / largest);
    this.most = Math.max(1, Math.min(contract.instances!.most, room));
  }

  /** How the last run ran; undefined before. */
  get kind(): SessionKind | undefined {
    return [...this.#steps.values()].sort((a, b) => b.lastUse - a.lastUse)[0]?.session.kind ?? this.#kind;
  }

  /** The session for so many instances, and how many it computes: as many or more. */
  sessionFor(instances: number): { readonly session: GeneratorSession; readonly count: number } {
    const count = Math.min(this.most, stepOf(instances));
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
