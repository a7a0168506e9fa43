import { GaussianSplatError, Lazy } from '@gaussian-splat/core';
import type { WorkerMessage, WorkerRequest } from './protocol.js';
import { WorkerSlot, type Job } from './worker-slot.js';

/** How long an unused worker is kept, because pages with several elements load one scene after another. */
const IDLE_MS = 5_000;
/** The same for one that has fetched for a streamed scene, whose camera may move again at any time. */
const STREAMING_IDLE_MS = 60_000;
/** Interval of pings to a busy worker, ms. */
const TICK_MS = 100;
/** Number of missed pings after which a worker gets no new requests. */
const BUSY = 2;
/** Number after which its other requests restart in another worker, and a worker with a canceled load is terminated. */
const SILENT = 5;
/** Number after which it counts as dead, even while reading, because browsers do not report that. */
const DEAD = 600;
/** Time limit of the start of a worker, ms; after it the load runs without the worker. */
const START_MS = 2_000;
const RESTART_MS = 15_000;
/** Additional time for the worker when everything for running without it is loaded, ms. */
const GRACE_MS = 500;
/** Maximum number of workers of a page. Untrusted scenes that never finish occupy one each; later loads wait. */
const MAX_WORKERS = 8;
/** Maximum number of restarts of a load, which may have been in a worker with several that never finish. */
const MAX_MOVES = 3;
/** Restart count of a load after a worker died while reading it: one more attempt. */
const AFTER_DEATH = 2;

const help = new Lazy('the code that starts workers', () => import('./start-helpers.js'));

/** Reports the reason that work runs on the main thread. */
export type Refusal = (reason: string) => void;

/**
 * The workers of a page. One serves all loads while it responds. If it does not, because it reads a large or a hostile
 * scene or has died, its other loads restart in another one; canceled work that does not stop is ended with its worker.
 */
export class WorkerPool {
  readonly #spawn: () => Worker;
  readonly #prepare: () => Promise<unknown>;
  readonly #onRefused: Refusal;
  readonly #another: () => boolean;
  readonly #slots = new Set<WorkerSlot>();
  readonly #queue: Job[] = [];
  #isRefused = false;
  #hasWarned = false;
  /** Whether the script has loaded once: if it does not load at once later, the machine is busy. */
  #hasStarted = false;
  #nextId = 0;
  #clock: ReturnType<typeof setInterval> | undefined;

  /**
   * @param prepare Loads the code for work on the main thread.
   * @param onRefused Called once if work runs there.
   * @param another Switches `spawn` to another way to start workers after a failure; false if there is none.
   */
  constructor(
    spawn: () => Worker,
    prepare: () => Promise<unknown>,
    onRefused: Refusal,
    another: () => boolean = () => false,
  ) {
    this.#spawn = spawn;
    this.#prepare = prepare;
    this.#onRefused = onRefused;
    this.#another = another;
  }

  /** Lets the next request try a worker again. */
  retry(): void {
    this.#isRefused = false;
  }

  /**
   * Sends a request to a worker. Rejects with GaussianSplatError, or with the signal's reason as soon as that is
   * aborted.
   * @param here Runs it on the main thread, if workers are not available.
   */
  async run<T>(
    request: WorkerRequest,
    signal: AbortSignal,
    here: () => Promise<T>,
    { transfer, ...listeners }: Pick<Job, 'onProgress' | 'onPreview' | 'onPart' | 'transfer'> = {},
  ): Promise<T> {
    signal.throwIfAborted();
    let cancel!: () => void;
    let job!: Job;
    const answer = new Promise<T>((resolve, reject) => {
      const id = this.#nextId++;
      job = { ...listeners, id, request, transfer, here, resolve: resolve as Job['resolve'], reject, moves: 0 };
      cancel = () => reject(signal.reason);
    });
    signal.addEventListener('abort', cancel, { once: true });
    this.#place(job);
    try {
      return await answer;
    } finally {
      signal.removeEventListener('abort', cancel);
      this.#remove(job);
    }
  }

  /** Assigns a request to a responsive worker, or to a new one. */
  #place(job: Job): void {
    if (this.#isRefused) return job.resolve(job.here());
    const slots = [...this.#slots];
    const late = slots.find(({ isLate }) => isLate);
    if (late) return void this.#doWithout(late, job);
    const free = slots.find((slot) => slot.missed < BUSY && slot.mayTake(job));
    const slot = free ?? (slots.length < MAX_WORKERS ? this.#start() : undefined);
    // The creation of a worker has failed and reported it.
    if (this.#isRefused) return job.resolve(job.here());
    if (!slot) return void this.#queue.push(job);
    slot.take(job);
    this.#watch();
  }

  #watch(): void {
    this.#clock ??= setInterval(this.#tick, TICK_MS);
  }

  /** The request was answered, failed or was canceled. */
  #remove(job: Job): void {
    const { slot } = job;
    const at = this.#queue.indexOf(job);
    if (at >= 0) this.#queue.splice(at, 1);
    if (!slot) return;
    slot.drop(job);
    this.#rest(slot, /^(file|box)/.test(job.request.type) ? STREAMING_IDLE_MS : IDLE_MS);
    this.#placeQueued();
  }

  #placeQueued(): void {
    for (const job of this.#queue.splice(0)) this.#place(job);
  }

  /** An idle worker ends after this time. */
  #rest(slot: WorkerSlot, idleMs: number): void {
    if (slot.jobs.size === 0) slot.rest(idleMs, () => this.#end(slot));
  }

  #start(): WorkerSlot | undefined {
    let worker: Worker;
    try {
      worker = this.#spawn();
    } catch (error) {
      if (this.#another()) return this.#start();
      this.#refuse(error instanceof Error ? error.message : String(error));
      return undefined;
    }
    const slot = new WorkerSlot(worker);
    this.#slots.add(slot);
    worker.addEventListener('message', ({ data }: MessageEvent<WorkerMessage>) => this.#receive(slot, data));
    worker.addEventListener('error', (event) => {
      event.preventDefault();
      if (slot.isReady) this.#crash(slot, event.message);
      else this.#fail(slot, event.message || 'its script could not be loaded');
    });
    slot.startTimer = setTimeout(() => this.#late(slot), this.#hasStarted ? RESTART_MS : START_MS);
    return slot;
  }

  #receive(slot: WorkerSlot, message: WorkerMessage): void {
    slot.missed = 0;
    if (message.type === 'ready') {
      slot.begin();
      this.#hasStarted = true;
      this.#watch();
      return this.#rest(slot, IDLE_MS);
    }
    if (message.type === 'pong') return;
    if (message.type === 'reading') return void (slot.reading = message.id);
    if (message.type === 'rested') return void (slot.reading = slot.reading === message.id ? undefined : slot.reading);
    const job = slot.jobs.get(message.id);
    if (message.type === 'progress') job?.onProgress?.(message.loaded, message.total);
    else if (message.type === 'preview') job?.onPreview?.(message.scene);
    else if (message.type === 'part') job?.onPart?.(message.part);
    else if (message.type === 'answer') job?.resolve(message.answer);
    else if (message.type === 'error') job?.reject(GaussianSplatError.fromData(message.error));
    else if (job) this.#help(slot, job.id, message.max).catch(() => undefined);
  }

  /** Starts helpers for a worker that packs a large scene: they end with that load. Without their code it packs alone. */
  async #help(slot: WorkerSlot, id: number, max: number): Promise<void> {
    const { startHelpers } = await help.get();
    if (slot.jobs.has(id)) slot.helpers.set(id, startHelpers(slot.worker, id, max, this.#spawn));
  }

  /** The page may not allow workers. */
  #fail(slot: WorkerSlot, reason: string): void {
    const jobs = [...slot.jobs.values()];
    this.#end(slot);
    if (!this.#another()) this.#refuse(reason);
    for (const job of jobs) this.#place(job);
  }

  #refuse(reason: string): void {
    this.#isRefused = true;
    this.#warn(reason);
    this.#placeQueued();
  }

  /** The worker's script does not load in time, but may later. */
  #late(slot: WorkerSlot): void {
    slot.isLate = true;
    for (const job of slot.jobs.values()) {
      slot.jobs.delete(job.id);
      void this.#doWithout(slot, job);
    }
    this.#placeQueued();
  }

  /** The code may load for both: then the worker is only a little later. */
  async #doWithout(slot: WorkerSlot, job: Job): Promise<void> {
    job.slot = undefined;
    try {
      await this.#prepare();
      await new Promise((resolve) => setTimeout(resolve, GRACE_MS));
      if (slot.isReady) return this.#place(job);
      this.#warn('its script does not come');
      job.resolve(job.here());
    } catch (error) {
      job.reject(error);
    }
  }

  #warn(reason: string): void {
    if (!this.#hasWarned) this.#onRefused(reason);
    this.#hasWarned = true;
  }

  readonly #tick = (): void => {
    let isIdle = true;
    for (const slot of this.#slots) {
      if (!slot.isAsked) continue;
      isIdle = false;
      if (slot.missed >= SILENT) this.#reassignJobs(slot);
      if (slot.missed++ === 0) slot.post({ type: 'ping' });
    }
    if (!isIdle) return;
    clearInterval(this.#clock);
    this.#clock = undefined;
  };

  /**
   * Requests in an unresponsive worker restart in others. Without a load of its own it reads a canceled one, or is
   * dead.
   */
  #reassignJobs(slot: WorkerSlot): void {
    const isDead = slot.missed >= DEAD;
    const reader = isDead ? undefined : slot.reader;
    const jobs = [...slot.jobs.values()].filter((job) => job !== reader);
    const stuckWorker = slot.reader;
    if (!reader) this.#end(slot);
    for (const job of jobs) this.#move(slot, job, job === stuckWorker ? AFTER_DEATH : 1);
    this.#placeQueued();
  }

  /** A load restarts alone in a worker, because it may have kept the other one busy. */
  #move(slot: WorkerSlot, job: Job, moves: number, found = 'a worker that gave no sign of life'): void {
    slot.drop(job);
    job.moves += moves;
    // Transferred buffers cannot be sent again.
    if (job.transfer || job.moves > MAX_MOVES) return job.reject(stopped(found));
    this.#place(job);
  }

  /**
   * A worker that dies after its start most likely ran out of memory: in its current read, or in its only load. The
   * others restart.
   */
  #crash(slot: WorkerSlot, message: string): void {
    const jobs = [...slot.jobs.values()];
    const stuckWorker = slot.reader ?? (jobs.length === 1 ? jobs[0] : undefined);
    this.#end(slot);
    for (const job of jobs)
      this.#move(slot, job, job === stuckWorker ? MAX_MOVES + 1 : 1, message || 'a worker that stopped');
    this.#placeQueued();
  }

  #end(slot: WorkerSlot): void {
    slot.end();
    this.#slots.delete(slot);
  }
}

function stopped(found: string): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/allocation', {
    where: 'scene worker',
    expected: 'a worker that finishes reading the scene',
    found,
    remedy: 'use a smaller scene, or close other pages',
  });
}
