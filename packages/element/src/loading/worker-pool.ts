import { GaussianSplatError, Lazy } from '@gaussian-splat/core';
import { FairTurns } from './fair-turns.js';
import { buffersOf, type PartListener } from './protocol.js';
import type { WorkerMessage, WorkerRequest } from './worker-messages.js';
import { WorkerSlot, type Job } from './worker-slot.js';

/** Time for which an idle worker is kept, ms, because pages with several elements load one scene after another. */
const IDLE_MS = 5_000;
/**
 * Time for which an idle worker is kept after it has fetched for a streamed scene, ms: the camera may move again at any
 * time.
 */
const STREAMING_IDLE_MS = 60_000;
/** Interval of pings to a busy worker, ms. */
const TICK_MS = 100;
/** Number of missed pings after which a worker gets no new requests. */
const BUSY = 2;
/**
 * Number of missed pings after which the requests of a worker may restart in other workers, except the one that it
 * reads. A worker that reads a canceled request is terminated.
 */
const SILENT = 5;
/** Silence after which a request restarts, however long its worker had worked for it before, ms. */
const MAX_WAIT_MS = 10_000;
/**
 * Number of missed pings after which a worker counts as dead, even while it reads, because browsers do not report dead
 * workers.
 */
const DEAD = 600;
/**
 * Time limit for the start of the first worker, ms. After it loads run on the main thread. The second limit applies
 * once a worker has started.
 */
const START_MS = 2_000;
const RESTART_MS = 15_000;
/** Time that a late worker gets after the code for the main thread is loaded, ms. */
const GRACE_MS = 500;
/**
 * Maximum number of workers of a page, and of those that start only for scenes that have had little worker time. Each
 * scene that is read for long occupies one. If all are occupied, later loads wait.
 */
const MAX_WORKERS = 8;
const MAX_NEW_WORKERS = 8;
/**
 * Maximum number of restarts of a load. Several restarts are allowed, because a load may share workers with scenes that
 * never finish.
 */
const MAX_MOVES = 3;
/**
 * Number that is added to the restarts of a load if its worker died while reading it, so that it restarts at most once
 * more.
 */
const AFTER_DEATH = 2;

const help = new Lazy('the code that starts workers', () => import('./start-helpers.js'));

/** Called with the reason for which work runs on the main thread. */
export type Refusal = (reason: string) => void;

/**
 * The workers of a page. One worker serves all loads while it responds. It does not respond while it reads a large or a
 * hostile scene, or if it has died. Its other loads then restart in another worker. Canceled work that does not stop is
 * ended with its worker.
 */
export class WorkerPool {
  readonly #spawn: () => Worker;
  readonly #prepare: () => Promise<unknown>;
  readonly #onRefused: Refusal;
  readonly #another: () => boolean;
  readonly #slots = new Set<WorkerSlot>();
  readonly #queue: Job[] = [];
  readonly #turns = new FairTurns();
  #isRefused = false;
  #hasWarned = false;
  /** Whether a worker has started before. If a later one starts slowly, the machine is busy, so it gets more time. */
  #hasStarted = false;
  #nextId = 0;
  #clock: ReturnType<typeof setInterval> | undefined;

  /**
   * @param spawn Starts a worker.
   * @param prepare Loads the code for work on the main thread.
   * @param onRefused Called once if work runs on the main thread.
   * @param another Switches `spawn` to another way to start workers after a failure. Returns false if there is no other
   * way.
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

  /** Allows the next request to start a worker, although an earlier one could not be started. */
  retry(): void {
    this.#isRefused = false;
  }

  /**
   * Sends a request to a worker, and returns its answer. Rejects with GaussianSplatError, or with the signal's reason
   * as soon as the signal is aborted.
   * @param here Runs the request on the main thread, if workers are not available.
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
      const settle = { resolve: resolve as Job['resolve'], reject };
      job = { ...listeners, ...settle, id, request, signal, transfer, here, moves: 0, sentAt: Infinity };
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

  /**
   * Assigns a request to a responsive worker, or to a new one. Runs it on the main thread if no worker can be started. A
   * request may have been canceled while it waited for a late worker.
   */
  #place(job: Job): void {
    if (job.signal.aborted) return;
    if (this.#isRefused) return job.resolve(job.here());
    const slots = [...this.#slots];
    const late = slots.find(({ isLate }) => isLate);
    if (late) return void this.#doWithout(late, job);
    const free = slots.find((slot) => slot.missed < BUSY && slot.mayTake(job));
    const max = MAX_WORKERS + (this.#turns.isNew(job) ? MAX_NEW_WORKERS : 0);
    const slot = free ?? (slots.length < max ? this.#start() : undefined);
    // No worker could be created, which `#start` has reported.
    if (this.#isRefused) return job.resolve(job.here());
    if (!slot) return void this.#queue.push(job);
    slot.take(job);
    this.#watch();
  }

  #watch(): void {
    this.#clock ??= setInterval(this.#tick, TICK_MS);
  }

  /** Removes a request that was answered, has failed or was canceled. */
  #remove(job: Job): void {
    const { slot } = job;
    const at = this.#queue.indexOf(job);
    if (at >= 0) this.#queue.splice(at, 1);
    if (!slot) return;
    slot.drop(job);
    this.#rest(slot, /^(file|box|clip)/.test(job.request.type) ? STREAMING_IDLE_MS : IDLE_MS);
    this.#placeQueued();
  }

  #placeQueued(): void {
    for (const job of this.#turns.sort(this.#queue.splice(0))) this.#place(job);
  }

  /** Ends a worker after `idleMs` milliseconds, if it has no requests and gets none until then. */
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
    else if (message.type === 'part') void this.#pass(slot, message.id, job?.onPart?.(message.part));
    else if (message.type === 'answer') job?.resolve(message.answer);
    else if (message.type === 'error') job?.reject(GaussianSplatError.fromData(message.error));
    else if (job) this.#help(slot, job.id, message.max).catch(() => undefined);
  }

  /** Returns the buffers of a part to the worker when the part has been used. */
  async #pass(slot: WorkerSlot, id: number, using: ReturnType<PartListener>): Promise<void> {
    const buffers = await Promise.resolve(using).catch(() => undefined);
    if (slot.jobs.has(id)) slot.post({ type: 'taken', id, buffers: buffers ?? undefined }, buffersOf(buffers ?? {}));
  }

  /**
   * Starts helpers for a worker that packs a large scene. They end with that load. If their code cannot be loaded, the
   * worker packs alone.
   */
  async #help(slot: WorkerSlot, id: number, max: number): Promise<void> {
    const { startHelpers } = await help.get();
    if (slot.jobs.has(id)) slot.helpers.set(id, startHelpers(slot.worker, id, max, this.#spawn));
  }

  /**
   * Handles a worker that could not be started, for example because the page does not allow workers. Its requests are
   * assigned again.
   */
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

  /**
   * Handles a worker that has not started in time, but may start later. Its requests run on the main thread unless it
   * starts soon.
   */
  #late(slot: WorkerSlot): void {
    slot.isLate = true;
    for (const job of slot.jobs.values()) {
      slot.jobs.delete(job.id);
      void this.#doWithout(slot, job);
    }
    this.#placeQueued();
  }

  /**
   * Runs a request on the main thread, unless the late worker starts first. The network may delay the code of both. In
   * that case the worker starts soon after the code for the main thread is loaded.
   */
  async #doWithout(slot: WorkerSlot, job: Job): Promise<void> {
    job.slot = undefined;
    try {
      await this.#prepare();
      await new Promise((resolve) => setTimeout(resolve, GRACE_MS));
      if (slot.isReady) return this.#place(job);
      this.#warn('its script does not arrive');
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
      if (slot.missed > 0 && slot.reader) this.#turns.count(slot.reader, TICK_MS);
      if (slot.missed >= SILENT) this.#reassignJobs(slot);
      if (slot.missed++ === 0) slot.post({ type: 'ping' });
    }
    this.#yieldTurn();
    if (!isIdle) return;
    clearInterval(this.#clock);
    this.#clock = undefined;
  };

  /** Ends a worker that has read for longer than its turn, if a new scene waits. Its requests wait for another turn. */
  #yieldTurn(): void {
    const [next] = this.#turns.sort(this.#queue);
    const slot = next && this.#turns.slotFor(next, this.#slots, ({ missed }) => missed * TICK_MS);
    if (!slot) return;
    const { reader } = slot;
    const jobs = [...slot.jobs.values()];
    this.#end(slot);
    for (const job of jobs) slot.drop(job);
    if (reader) reader.turns = (reader.turns ?? 0) + 1;
    this.#queue.push(...jobs);
    this.#placeQueued();
  }

  /**
   * Restarts the requests of an unresponsive worker in other workers, except the load that it reads. The worker is
   * ended if it is dead, or reads a canceled load.
   */
  #reassignJobs(slot: WorkerSlot): void {
    const isDead = slot.missed >= DEAD;
    const reader = isDead ? undefined : slot.reader;
    const silentMs = slot.missed * TICK_MS;
    const isLeft = isDead || (slot.reading !== undefined && !reader);
    const mayMove = (job: Job): boolean => isLeft || hasWaited(job, silentMs);
    const jobs = [...slot.jobs.values()].filter((job) => job !== reader && mayMove(job));
    const isEmpty = jobs.length === slot.jobs.size;
    const stuckWorker = slot.reader;
    if (!reader && isEmpty) this.#end(slot);
    for (const job of jobs)
      if (job === stuckWorker) this.#move(slot, job, AFTER_DEATH, stopped('a worker that did not respond'));
      else this.#move(slot, job, 1, starved());
    this.#placeQueued();
  }

  /**
   * Restarts a load in another worker. A load that has been restarted does not share its worker, because it may have
   * blocked the previous one. Rejects the load if it cannot restart.
   */
  #move(slot: WorkerSlot, job: Job, moves: number, error: GaussianSplatError): void {
    slot.drop(job);
    job.moves += moves;
    // Transferred buffers cannot be sent again.
    if (job.transfer || job.moves > MAX_MOVES) return job.reject(error);
    this.#place(job);
  }

  /**
   * Handles a worker that died after its start, most likely because memory ran out. The load that it was reading, or
   * its only load, is rejected. The other loads restart.
   */
  #crash(slot: WorkerSlot, message: string): void {
    const jobs = [...slot.jobs.values()];
    const stuckWorker = slot.reader ?? (jobs.length === 1 ? jobs[0] : undefined);
    this.#end(slot);
    for (const job of jobs)
      this.#move(slot, job, job === stuckWorker ? MAX_MOVES + 1 : 1, stopped(message || 'a worker that stopped'));
    this.#placeQueued();
  }

  #end(slot: WorkerSlot): void {
    slot.end();
    this.#slots.delete(slot);
  }
}

/**
 * Returns whether a job may leave a silent worker that is perhaps only late, because the machine is busy. It loses what
 * it has downloaded, so the silence must have lasted as long as the job before it. The time quadruples with each
 * restart. A job that cannot restart, or not again, waits until its worker counts as dead.
 */
function hasWaited({ sentAt, moves, transfer }: Job, silentMs: number): boolean {
  const workedMs = performance.now() - sentAt - silentMs;
  const minMs = TICK_MS * SILENT * 4 ** moves;
  return !transfer && moves < MAX_MOVES && silentMs >= Math.max(minMs, Math.min(MAX_WAIT_MS, workedMs));
}

/** Returns the error for a request that no worker began to read, because the machine gave workers no time. */
function starved(): GaussianSplatError {
  return new GaussianSplatError('network/interrupted', {
    where: 'scene worker',
    expected: 'a worker that responds within a minute',
    found: 'none, and no scene that it was reading',
    remedy: 'load the scene again when the machine is less busy',
  });
}

function stopped(found: string): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/allocation', {
    where: 'scene worker',
    expected: 'a worker that finishes reading the scene',
    found,
    remedy: 'use a smaller scene, or close other pages',
  });
}
