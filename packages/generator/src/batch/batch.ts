import type { Inputs } from '../input-value.js';
import { RunLoop } from '../run-loop.js';
import type { GeneratorSession } from '../runtime/generator-session.js';
import type { RunOutputs, SessionKind } from '../runtime/ort-session.js';
import { groupInstances, inputsOfInstances, stackInputs } from './stack-inputs.js';
import { StepSessions } from './step-sessions.js';

/**
 * Resolves at the end of the current task. All callbacks of one animation frame are one task, so by then the elements
 * of a page have made all requests of the frame. A message is used because browsers throttle timers.
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

/** Latest request of an instance. */
interface RunRequest {
  readonly inputs: Inputs;
}

/** One instance of a batch. */
export interface BatchMember<W extends RunRequest> {
  /** Whether a request requires a run. */
  readonly isDue: (request: W) => boolean;
  /**
   * Consumes the output of a run; `instance` is the index of this instance in it. It must submit its work before it
   * returns.
   */
  readonly take: (request: W, outputs: RunOutputs, instance: number) => void;
  /** Called when the run is submitted; `start` is its start time by `performance.now()`. */
  readonly onTaken: (request: W, start: number) => void;
  readonly onError: (error: unknown) => void;
}

const batches = new WeakMap<GeneratorSession, Batch>();

/** The batch of all instances of a session. @param session Its model declares instances. */
export function batchOf(session: GeneratorSession): Batch {
  let batch = batches.get(session);
  if (batch === undefined) batches.set(session, (batch = new Batch(session)));
  return batch;
}

/**
 * All instances of one generator on one device: requests within a task run together, each instance with its own inputs,
 * and each gets its slice of the output. The latest request of each instance wins, and a single loop keeps them
 * together.
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

  /** Session kind; undefined before the first run. */
  get kind(): SessionKind | undefined {
    return this.#steps.kind;
  }

  /** Adds an instance. */
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
    // The next instance starts a new batch.
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
  /** Resolvers to call when no run is in progress. */
  #waiting: (() => void)[] = [];

  constructor(batch: Batch, member: BatchMember<W>, calls: { readonly ask: () => void; readonly leave: () => void }) {
    this.#batch = batch;
    this.member = member;
    this.#calls = calls;
  }

  get isClosed(): boolean {
    return this.#isClosed;
  }

  /** Session kind of the batch; undefined before its first run. */
  get kind(): SessionKind | undefined {
    return this.#batch.kind;
  }

  /** Resolves, and never rejects, when no run for this instance is in progress; runs of other instances may continue. */
  get idle(): Promise<void> {
    return this.#isBusy ? new Promise((resolve) => this.#waiting.push(resolve)) : Promise.resolve();
  }

  /** Whether there is a request that requires a run. */
  get isDue(): boolean {
    return this.#request !== undefined && this.member.isDue(this.#request);
  }

  /** Inputs of the last request taken. */
  get inputs(): Inputs {
    return this.#taken?.inputs ?? {};
  }

  /** Returns at once; a request that has not started yet is replaced. */
  request(request: W): void {
    if (this.#isClosed) return;
    this.#request = request;
    this.#calls.ask();
  }

  /** Takes the request; its run is in progress until {@link settle}. */
  takeRequest(): W | undefined {
    this.#taken = this.#request;
    this.#request = undefined;
    this.#isRunning = true;
    return this.#taken;
  }

  /** Marks the end of the run of the taken request. */
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
