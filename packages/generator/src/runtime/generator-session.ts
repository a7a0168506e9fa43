import { GaussianSplatError } from '@gaussian-splat/core';
import { ContractError, ofInstances, oneInstance } from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import { bindInputs } from '../bind-inputs.js';
import { bindImages } from '../bind-images.js';
import type { Inputs } from '../input-value.js';
import type { GeneratorState } from '../state.js';
import { WeightRelease } from './cadence.js';
import type { OrtSession, RunOutputs, SessionKind } from './ort-session.js';
import { RuntimeGone } from './load-runtime.js';
import type { GeneratorModel } from './open-model.js';
import { earlierVerdict, prove, type Evidence } from '../cpu-check/prove.js';
import type { StartWorker } from '../cpu-check/run-on-cpu.js';
import type { CpuCheckResult } from '../cpu-check/record.js';
import { ELEMENT_BYTES } from './tensor-buffers.js';
import { runFault, startSession } from './start-session.js';

/** Number of consecutive failures after which a model is abandoned or, if it has run before, paused. */
const MAX_FAILURES = 2;
/** Initial pause after failures, milliseconds. Each further failure doubles it up to {@link LONGEST_REST_MS}. */
const FIRST_REST_MS = 250;
const LONGEST_REST_MS = 2_000;
/** Maximum number of copies of the runtime that one run is tried with, because other models may break a copy. */
const MAX_COPIES = 5;

/**
 * A generator on one device, with one session of the runtime that all users share. After a failed run, the next run
 * starts another session of the runtime.
 */
export class GeneratorSession {
  readonly model: GeneratorModel;
  readonly device: GPUDevice;
  readonly #onFallback: (reason: string) => void;
  readonly #gpuCheck: boolean | StartWorker;
  readonly #end = new AbortController();
  readonly #oneInstance: OnnxHeader;
  readonly #weights: WeightRelease;
  #live: Promise<OrtSession> | undefined;
  #kind: SessionKind | undefined;
  #failures = 0;
  #lastFailure: unknown;
  #hasRun = false;
  /** Whether the last failure broke a copy of the runtime. */
  #hasBroken = false;
  #isLost = false;
  #isReleased = false;
  /** Reason that the model does not run on the GPU anymore; undefined if it may. */
  #refusal: string | undefined;
  #verdict: CpuCheckResult | undefined;

  /**
   * Creates a session without starting the runtime.
   * @param onFallback Called once if the model has to run on the CPU, with the reason.
   * @param gpuCheck Whether the output of the first run on the GPU is compared with that on the CPU. A function starts
   * the worker for the comparison.
   * @throws GaussianSplatError `out-of-memory/buffer-limit` if an output is larger than the device's buffers.
   */
  constructor(
    model: GeneratorModel,
    device: GPUDevice,
    onFallback: (reason: string) => void = () => undefined,
    gpuCheck: boolean | StartWorker = true,
  ) {
    this.model = model;
    this.device = device;
    this.#onFallback = onFallback;
    this.#gpuCheck = gpuCheck;
    this.#oneInstance = oneInstance(model.header, model.contract);
    this.#weights = new WeightRelease(model, () => void this.#releaseDynamic());
    requireRoom(model, device);
    // The device may outlive many sessions, and its promise keeps all that waits for it alive.
    const own = new WeakRef(this);
    void device.lost.then(() => {
      const session = own.deref();
      if (!session) return;
      session.#isLost = true;
      session.#end.abort();
    });
  }

  /** Kind of the session; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#kind;
  }

  /** Result of the comparison with the CPU; undefined before it, usually for some seconds after the first run. */
  get verdict(): CpuCheckResult | undefined {
    return this.#verdict;
  }

  /**
   * Returns the inputs of one instance for a state of the page.
   * @param given Names of inputs that another model writes, which are excluded.
   * @throws GaussianSplatError `argument/value`
   */
  bind(state: GeneratorState, given: ReadonlySet<string> = new Set()): Inputs {
    const { contract } = this.model;
    const header = this.#oneInstance;
    return { ...bindInputs(header, contract, state), ...bindImages(header, contract, state, given) };
  }

  /**
   * Returns another session of the same model, for exactly this number of instances.
   * @throws GaussianSplatError `out-of-memory/buffer-limit` if an output is larger than the device's buffers.
   */
  forInstances(count: number): GeneratorSession {
    const { header, contract, outputs, ...rest } = this.model;
    const model: GeneratorModel = {
      ...rest,
      contract,
      header: ofInstances(header, contract, count),
      outputs: outputs.map((output) => ({ ...output, max: output.max && output.max * count })),
      instances: count,
    };
    return new GeneratorSession(model, this.device, this.#onFallback, this.#gpuCheck);
  }

  /**
   * Runs the model, and calls `use` with its outputs. `use` must submit its GPU work before it returns. The first run
   * also starts the session, and `use` is called before graph capture begins.
   * @throws ContractError `contract/run` if the runtime fails; GaussianSplatError `device-lost/unrecoverable` if the
   * device is lost, `network/*` if the runtime cannot be fetched; errors of `use`.
   */
  async run(inputs: Inputs, use: (outputs: RunOutputs) => void): Promise<void> {
    for (let copies = 1; ; copies++) {
      try {
        return await this.#runOnce(inputs, use);
      } catch (error) {
        // Another model has broken this session's copy of the runtime, so the session starts again in the next copy.
        if (!(error instanceof RuntimeGone) || copies === MAX_COPIES) throw error;
      }
    }
  }

  /** Whether the model is abandoned: repeated failures before it has ever run, or failures that break the runtime. */
  get hasGivenUp(): boolean {
    return this.#failures >= MAX_FAILURES && (!this.#hasRun || this.#hasBroken);
  }

  async #runOnce(inputs: Inputs, use: (outputs: RunOutputs) => void): Promise<void> {
    this.#weights.runBegins();
    await this.#rest();
    const first = new FirstUse((outputs) => {
      // A lost device writes nothing, which the runtime does not detect.
      this.#requireLife();
      use(outputs);
    });
    const starting = (this.#live ??= this.#start(inputs, first.take));
    const live = await this.#started(starting);
    try {
      // If this request has started the session, the first run of the session has served it.
      if (first.isTaken) first.requireSuccess();
      else await live.run(inputs, first.use);
      this.#failures = 0;
      this.#hasRun = true;
      this.#hasBroken = false;
      this.#weights.runEnded();
    } catch (error) {
      throw await this.#afterFailure(live, starting, error);
    }
  }

  /** Waits after failed runs. @throws the last error if the model is abandoned; errors of {@link #requireLife} */
  async #rest(): Promise<void> {
    this.#requireLife();
    if (this.#failures < MAX_FAILURES) return;
    if (this.hasGivenUp) throw this.#lastFailure;
    // Valid inputs may follow invalid ones, but restarting takes time.
    const ms = Math.min(LONGEST_REST_MS, FIRST_REST_MS * 2 ** (this.#failures - MAX_FAILURES));
    await new Promise((resolve) => setTimeout(resolve, ms));
    this.#requireLife();
  }

  async #started(starting: Promise<OrtSession>): Promise<OrtSession> {
    try {
      return await starting;
    } catch (error) {
      const isFirst = this.#live === starting;
      if (isFirst) this.#live = undefined;
      this.#requireLife();
      if (error instanceof ContractError && isFirst) {
        this.#lastFailure = error;
        // A contract error is permanent: a second attempt would fail in the same way.
        this.#failures = Math.max(MAX_FAILURES, this.#failures + 1);
      }
      throw error;
    }
  }

  /** Releases the session permanently. Further runs are rejected. */
  async release(): Promise<void> {
    this.#isReleased = true;
    this.#weights.runBegins();
    this.#end.abort();
    await this.#releaseDynamic();
  }

  /** Releases the runtime's session with its weights. A later run starts another session. */
  async #releaseDynamic(): Promise<void> {
    const live = this.#live;
    this.#live = undefined;
    await live?.then(
      (session) => session.release(),
      () => undefined,
    );
  }

  async #start(inputs: Inputs, onFirstRun: (outputs: RunOutputs) => void): Promise<OrtSession> {
    const { model, device } = this;
    const requireLife = (): void => this.#requireLife();
    const onFallback = this.#kind === 'wasm' ? () => undefined : this.#onFallback;
    if (this.#gpuCheck) this.#verdict ??= await earlierVerdict(model, device);
    if (this.#verdict?.result === 'different') this.#refusal ??= this.#verdict.reason;
    const { session, evidence } = await startSession({
      model,
      device,
      inputs,
      requireLife,
      onBreakage: () => (this.#hasBroken = true),
      onFallback,
      refusal: this.#refusal,
      keepsEvidence: this.#gpuCheck !== false && this.#verdict === undefined,
      onFirstRun,
    });
    this.#kind = session.kind;
    if (evidence) void this.#prove(evidence);
    return session;
  }

  /**
   * Compares the output of the GPU with that of the CPU. If it is wrong, the model runs on the CPU from the next run
   * on.
   */
  async #prove(evidence: Evidence): Promise<void> {
    const startWorker = typeof this.#gpuCheck === 'function' ? this.#gpuCheck : undefined;
    const verdict = await prove(this.model, this.device, evidence, this.#end.signal, startWorker);
    if (this.#end.signal.aborted) return;
    this.#verdict = verdict;
    if (verdict.result !== 'different' || this.#kind === 'wasm') return;
    this.#refusal = verdict.reason;
    this.#kind = 'wasm';
    void this.#releaseDynamic();
    this.#onFallback(verdict.reason);
  }

  async #afterFailure(live: OrtSession, starting: Promise<OrtSession>, error: unknown): Promise<unknown> {
    const isGone = error instanceof RuntimeGone;
    if (!live.hasFailed && !isGone) return error;
    const isFirst = this.#live === starting;
    if (isFirst) {
      this.#live = undefined;
      await live.release();
    }
    if (isGone) return error;
    if (this.#isLost) return deviceLost(error);
    const fault = new ContractError([runFault(this.model, error instanceof Error ? error.message : String(error))]);
    if (isFirst) {
      this.#failures++;
      this.#hasBroken = live.runtime.isBroken;
      this.#lastFailure = fault;
    }
    return fault;
  }

  #requireLife(): void {
    if (this.#isLost) throw deviceLost(undefined);
    if (this.#isReleased) throw new DOMException('The generator was closed', 'AbortError');
  }
}

/**
 * Passes the outputs of the run that starts a session to `use`. Errors of `use` must not count as faults of that run.
 */
class FirstUse {
  readonly use: (outputs: RunOutputs) => void;
  #taken: { readonly error?: unknown } | undefined;

  constructor(use: (outputs: RunOutputs) => void) {
    this.use = use;
  }

  get isTaken(): boolean {
    return this.#taken !== undefined;
  }

  readonly take = (outputs: RunOutputs): void => {
    this.#taken = {};
    try {
      this.use(outputs);
    } catch (error) {
      this.#taken = { error };
    }
  };

  /** Throws the error that `use` has thrown, if any. */
  requireSuccess(): void {
    if (this.#taken && 'error' in this.#taken) throw this.#taken.error;
  }
}

/**
 * Requires that each output fits into one buffer, which the runtime allocates.
 * @throws GaussianSplatError `out-of-memory/buffer-limit`
 */
function requireRoom({ header, outputs }: GeneratorModel, { limits }: GPUDevice): void {
  for (const { name, dtype, max = 0 } of outputs) {
    const bytes = max * ELEMENT_BYTES[dtype];
    if (bytes <= limits.maxBufferSize) continue;
    throw new GaussianSplatError('out-of-memory/buffer-limit', {
      where: `output ${name} of ${header.name}`,
      expected: `at most ${limits.maxBufferSize} bytes, the device's maxBufferSize`,
      found: `${bytes} bytes`,
      remedy: 'export fewer Gaussians (a lower nMax), or float16, or one tensor for each attribute',
    });
  }
}

function deviceLost(cause: unknown): GaussianSplatError {
  return new GaussianSplatError('device-lost/unrecoverable', {
    where: 'GPU device of the generator',
    expected: 'an available device',
    found: 'a lost device',
    remedy: 'open the generator again on a new device',
    cause,
  });
}
