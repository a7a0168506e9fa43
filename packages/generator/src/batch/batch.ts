import type { Inputs } from '../input-value.js';
import { RunLoop } from '../run-loop.js';
import type { GeneratorSession } from '../runtime/generator-session.js';
import type { RunOutputs, SessionKind } from '../runtime/ort-session.js';
import { groupInstances, inputsOfInstances, stackInputs } from './stack-inputs.js';
import { StepSessions } from './step-sessions.js';

/**
 * Fulfills at the end of the current task. All callbacks of one animation frame are one task, so the elements of a page
 * have made all requests of the frame by then. Uses a message, because browsers throttle timers.
 */
export function endOfTask(): Promise<void> {
  return new Promise((resolve) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => {
      port1.close();
      resolve();
    };
    port2.postMessage(undefined);
  });
}

/** A request of an instance. */
interface RunRequest {
  readonly inputs: Inputs;
}

/** One instance of a batch. */
export interface BatchMember<W extends RunRequest> {
  /** Whether a request requires a run. False, for example, if its inputs equal those of the last run. */
  readonly isDue: (request: W) => boolean;
  /**
   * Consumes the output of a run. `instance` is the index of this instance in the output. The function must submit its
   * GPU work before it returns.
   */
  readonly take: (request: W, outputs: RunOutputs, instance: number) => void;
  /**
   * Called when the work of the run is submitted. `start` is the start of the run, milliseconds by `performance.now()`.
   */
  readonly onTaken: (request: W, start: number) => void;
  readonly onError: (error: unknown) => void;
}

const batches = new WeakMap<GeneratorSession, Batch>();

/** Returns the batch of all instances of a session. @param session A session whose model declares instances. */
export function batchOf(session: GeneratorSession): Batch {
  let batch = batches.get(session);
  if (batch === undefined) batches.set(session, (batch = new Batch(session)));
  return batch;
}

/**
 * All instances of one generator on one device. Requests within one task run together. Each instance has its own
 * inputs, and receives its part of the output. Only the latest request of each instance runs.
 */
export class Batch {
  readonly #session: GeneratorSession;
  readonly #varying: ReadonlySet<string>;
  readonly #steps: StepSessions;
  readonly #seats = new Set<BatchSlot<RunRequest>>();
  readonly #loop: RunLoop<true>;

  constructor(session: GeneratorSession) {
    this.#session = session;
    const { header, contract } = session.model;
    this.#varying = inputsOfInstances(header, contract);
    this.#steps = new StepSessions(session);
    this.#loop = new RunLoop({
      queue: session.device.queue,
      isDue: () => this.#due().length > 0,
      run: () => this.#run(),
      onError: (error) => this.#seats.forEach((seat) => seat.member.onError(error)),
    });
  }

  /** Kind of the session; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#steps.kind;
  }

  /** Adds an instance, and returns its slot. */
  join<W extends RunRequest>(member: BatchMember<W>): BatchSlot<W> {
    const seat = new BatchSlot(this, member, {
      ask: () => this.#loop.request(true),
      leave: () => this.#leave(seat as unknown as BatchSlot<RunRequest>),
    });
    this.#seats.add(seat as unknown as BatchSlot<RunRequest>);
    return seat;
  }

  #leave(seat: BatchSlot<RunRequest>): void {
    this.#seats.delete(seat);
    if (this.#seats.size > 0) return;
    this.#loop.close();
    // The next instance of this session starts a new batch.
    if (batches.get(this.#session) === this) batches.delete(this.#session);
    void this.#loop.idle.then(() => this.#steps.release());
  }

  #due(): BatchSlot<RunRequest>[] {
    return [...this.#seats].filter((seat) => seat.isDue);
  }

  async #run(): Promise<void> {
    await endOfTask();
    const asked = this.#due().map((seat) => ({ seat, request: seat.takeRequest()!, inputs: seat.inputs }));
    try {
      for (const group of groupInstances(asked, this.#varying, this.#steps.max)) await this.#runGroup(group);
    } finally {
      for (const { seat } of asked) seat.settle();
    }
  }

  async #runGroup(
    group: readonly { seat: BatchSlot<RunRequest>; request: RunRequest; inputs: Inputs }[],
  ): Promise<void> {
    const start = performance.now();
    const failed = new Set<BatchSlot<RunRequest>>();
    const fail = (seat: BatchSlot<RunRequest>, error: unknown): void => {
      failed.add(seat);
      if (!seat.isClosed) seat.member.onError(error);
    };
    try {
      const { session, count } = this.#steps.sessionFor(group.length);
      const inputs = stackInputs(
        group.map((each) => each.inputs),
        this.#varying,
        count,
      );
      await session.run(inputs, (outputs) => {
        group.forEach(({ seat, request }, instance) => {
          if (seat.isClosed) return;
          try {
            seat.member.take(request, outputs, instance);
          } catch (error) {
            // The failure of one instance does not affect the others.
            fail(seat, error);
          }
        });
      });
    } catch (error) {
      for (const { seat } of group) fail(seat, error);
    }
    for (const { seat, request } of group) if (!seat.isClosed && !failed.has(seat)) seat.member.onTaken(request, start);
  }
}

/** One instance in a batch, with the interface of a {@link RunLoop}. */
export class BatchSlot<W extends RunRequest> {
  readonly member: BatchMember<W>;
  readonly #batch: Batch;
  readonly #calls: { readonly ask: () => void; readonly leave: () => void };
  #request: W | undefined;
  #taken: W | undefined;
  #isRunning = false;
  #isClosed = false;
  /** Functions that fulfill the promises of {@link idle} when no run is in progress. */
  #waiting: (() => void)[] = [];

  constructor(batch: Batch, member: BatchMember<W>, calls: { readonly ask: () => void; readonly leave: () => void }) {
    this.#batch = batch;
    this.member = member;
    this.#calls = calls;
  }

  get isClosed(): boolean {
    return this.#isClosed;
  }

  /** Kind of the batch's session; undefined before its first run. */
  get kind(): SessionKind | undefined {
    return this.#batch.kind;
  }

  /** Fulfills when no run for this instance is in progress. Never rejects. Runs of other instances may continue. */
  get idle(): Promise<void> {
    return this.#isBusy ? new Promise((resolve) => this.#waiting.push(resolve)) : Promise.resolve();
  }

  /** Whether the latest request requires a run. */
  get isDue(): boolean {
    return this.#request !== undefined && this.member.isDue(this.#request);
  }

  /** Inputs of the last request that was taken; empty before the first. */
  get inputs(): Inputs {
    return this.#taken?.inputs ?? {};
  }

  /** Requests a run and returns at once. Replaces a request that has not started yet. */
  request(request: W): void {
    if (this.#isClosed) return;
    this.#request = request;
    this.#calls.ask();
  }

  /**
   * Takes the latest request, and returns it; undefined if there is none. Its run counts as in progress until {@link
   * settle}.
   */
  takeRequest(): W | undefined {
    this.#taken = this.#request;
    this.#request = undefined;
    this.#isRunning = true;
    return this.#taken;
  }

  /** Marks the run of the taken request as ended. */
  settle(): void {
    this.#isRunning = false;
    if (this.#isBusy) return;
    for (const resolve of this.#waiting.splice(0)) resolve();
  }

  close(): void {
    if (this.#isClosed) return;
    this.#isClosed = true;
    this.#request = undefined;
    if (!this.#isRunning) this.settle();
    this.#calls.leave();
  }

  get #isBusy(): boolean {
    return this.#isRunning || this.isDue;
  }
}
