import { GaussianSplatError, Lazy } from '@gaussian-splat/core';
import { FairTurns } from './fair-turns.js';
import { buffersOf, type PartListener } from './protocol.js';
import type { WorkerMessage, WorkerRequest } from './worker-messages.js';
import { isDownloaded, WorkerSlot, type Job } from './worker-slot.js';

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
 * Number of missed pings after which a worker counts as dead, even while it reads, in browsers that do not report that
 * a worker has ended.
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
/** Number of nodes of a tree that wait in one worker before another starts, and maximum number of workers for nodes. */
const NODES_AT_ONCE = 3;
const MAX_NODE_WORKERS = 8;
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

/** Time after which a worker that reads counts as slow, ms. Slow ones do not keep downloaded scenes waiting. */
const SLOW_MS = 2_000;

/**
 * Called with the reason for which work runs on the main thread.
 * @param isLate Whether a worker has only not started in time.
 */
export type Refusal = (reason: string, isLate: boolean) => void;

/**
 * The workers of a page. One worker downloads all scenes. It reads its last one, and hands the others on, because it
 * does not respond while it reads. Silence alone ends nothing: a busy machine gives workers no time. Only loads that wait
 * behind a long reading restart in another worker. Canceled work that does not stop is ended with its worker.
 */
export class WorkerPool {
  readonly #spawn: () => Worker;
  readonly #prepare: () => Promise<unknown>;
  readonly #onRefused: Refusal;
  readonly #another: () => boolean;
  readonly #slots = new Set<WorkerSlot>();
  readonly #queue: Job[] = [];
  readonly #turns = new FairTurns();
  /** The workers that keep parts of files: see `Job.keeper`. */
  readonly #keepers = new Map<string | undefined, WorkerSlot>();
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
    here: (request: WorkerRequest) => Promise<T>,
    options: Pick<Job, 'onProgress' | 'onPreview' | 'onPart' | 'transfer' | 'keeper'> = {},
  ): Promise<T> {
    signal.throwIfAborted();
    let cancel!: () => void;
    let job!: Job;
    const answer = new Promise<T>((resolve, reject) => {
      const id = this.#nextId++;
      const settle = { resolve: resolve as Job['resolve'], reject };
      job = { ...options, ...settle, id, request, signal, here, moves: 0, sentAt: Infinity };
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
    if (this.#isRefused) return job.resolve(job.here(job.request));
    const slots = [...this.#slots];
    const late = slots.find(({ isLate }) => isLate);
    // Another worker that has started does the work of a late one.
    if (late && !slots.some(({ isReady }) => isReady)) return void this.#doWithout(late, job);
    const isFree = (slot: WorkerSlot, max: number): boolean => slot.missed < max && slot.mayTake(job);
    const keeper = this.#keepers.get(job.keeper);
    const ready = slots.filter((slot) => isFree(slot, BUSY));
    // A worker unpacks a node much longer than it waits for its bytes, so nodes are spread over workers.
    const isNode = job.request.type === 'node';
    if (isNode) ready.sort((a, b) => a.jobs.size - b.jobs.size);
    const isFull =
      isNode &&
      ready[0]?.jobs.size >= NODES_AT_ONCE &&
      slots.length < Math.min(MAX_NODE_WORKERS, navigator.hardwareConcurrency);
    const free = keeper && isFree(keeper, SILENT) ? keeper : isFull ? undefined : ready[0];
    const slot = free ?? (this.#mayStart(job) ? this.#start() : undefined);
    // No worker could be created, which `#start` has reported.
    if (this.#isRefused) return job.resolve(job.here(job.request));
    if (!slot) return void this.#queue.push(job);
    slot.take(job);
    if (job.keeper) this.#keepers.set(job.keeper, slot);
    this.#watch();
  }

  /**
   * Returns whether a request gets a new worker. Downloaded scenes are read by as many workers as the machine has cores,
   * slow ones not counted.
   */
  #mayStart(job: Job): boolean {
    const slots = [...this.#slots];
    if (slots.length >= MAX_WORKERS + (this.#turns.isNew(job) ? MAX_NEW_WORKERS : 0)) return false;
    const isQuick = ({ jobs, missed }: WorkerSlot): boolean =>
      missed * TICK_MS < SLOW_MS && [...jobs.values()].some(isDownloaded);
    return !isDownloaded(job) || slots.filter(isQuick).length < Math.max(2, navigator.hardwareConcurrency);
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
    this.#rest(slot, /^(file|box|node|clip)/.test(job.request.type) ? STREAMING_IDLE_MS : IDLE_MS);
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
    const slot: WorkerSlot = new WorkerSlot(worker, () => this.#crash(slot, 'a worker that the browser ended'));
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
      this.#rest(slot, IDLE_MS);
      return this.#placeQueued();
    }
    if (message.type === 'pong') return void (slot.heardAt = slot.pingedAt);
    if (message.type === 'holds') return slot.held(message.name);
    if (message.type === 'reading') return void (slot.reading = message.id);
    if (message.type === 'rested') return void (slot.reading = slot.reading === message.id ? undefined : slot.reading);
    const job = slot.jobs.get(message.id);
    if (message.type === 'progress') job?.onProgress?.(message.loaded, message.total);
    else if (message.type === 'preview') job?.onPreview?.(message.scene);
    else if (message.type === 'part') void this.#pass(slot, message.id, job?.onPart?.(message.part));
    else if (message.type === 'downloaded') this.#handOn(slot, job, message.file);
    else if (message.type === 'answer') job?.resolve(message.answer);
    else if (message.type === 'error') job?.reject(GaussianSplatError.fromData(message.error));
    else if (job) this.#help(slot, job.id, message.max).catch(() => undefined);
  }

  /** Assigns a downloaded scene to another worker. */
  #handOn(slot: WorkerSlot, job: Job | undefined, downloaded: Blob): void {
    if (!job) return;
    slot.drop(job);
    job.request = { ...job.request, request: { ...job.request.request, downloaded } } as WorkerRequest;
    this.#place(job);
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
    const jobs = [...slot.jobs.values()];
    for (const job of jobs) slot.drop(job);
    for (const job of jobs) this.#place(job);
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
      this.#warn(`none has started within ${START_MS / 1000} s`, true);
      job.resolve(job.here(job.request));
    } catch (error) {
      job.reject(error);
    }
  }

  #warn(reason: string, isLate = false): void {
    if (!this.#hasWarned) this.#onRefused(reason, isLate);
    this.#hasWarned = true;
  }

  readonly #tick = (): void => {
    let isIdle = true;
    for (const slot of this.#slots) {
      if (!slot.isAsked) continue;
      isIdle = false;
      if (slot.missed > 0 && slot.reader) this.#turns.count(slot.reader, TICK_MS);
      if (slot.missed >= SILENT) this.#reassignJobs(slot);
      if (slot.missed++ > 0) continue;
      slot.pingedAt = performance.now();
      slot.post({ type: 'ping' });
    }
    this.#placeQueued();
    this.#yieldTurn();
    if (!isIdle) return;
    clearInterval(this.#clock);
    this.#clock = undefined;
  };

  /** Ends a worker that has read for longer than its turn, if a new scene waits. Its requests wait for another turn. */
  #yieldTurn(): void {
    if (this.#slots.size < MAX_WORKERS + MAX_NEW_WORKERS) return;
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
   * Restarts requests of a silent worker in other workers: those that wait behind a scene that it reads, those that it
   * has not received, or all if it reads a canceled one. The worker is ended in the last case. Silence alone means that
   * the machine gives it no time. If the end of workers is not reported, nothing but time is left to judge by.
   */
  #reassignJobs(slot: WorkerSlot): void {
    const silentMs = slot.missed * TICK_MS;
    const isDead = slot.missed >= DEAD && !slot.reportsEnd;
    const { reader } = slot;
    const isReading = slot.reading !== undefined;
    const isLeft = isDead || (isReading && !reader);
    const mayMove = (job: Job): boolean =>
      job !== reader && (isReading || slot.heardAt < job.sentAt) && hasWaited(job, silentMs);
    const jobs = [...slot.jobs.values()].filter((job) => isLeft || mayMove(job));
    if (isLeft || (jobs.length > 0 && jobs.length === slot.jobs.size)) this.#end(slot);
    for (const job of jobs) {
      const moves = isDead && job === reader ? AFTER_DEATH : 1;
      this.#move(slot, job, isDead ? moves : Math.min(moves, MAX_MOVES - job.moves), silent(silentMs, job === reader));
    }
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
   * Handles a worker that died after its start, most likely because memory ran out. Its loads restart. The one that it
   * was reading, or its only one, restarts once.
   */
  #crash(slot: WorkerSlot, message: string): void {
    const jobs = [...slot.jobs.values()];
    const suspect = slot.reader ?? (jobs.length === 1 ? jobs[0] : undefined);
    this.#end(slot);
    for (const job of jobs)
      this.#move(slot, job, job === suspect ? AFTER_DEATH : 1, stopped(message || 'a worker that stopped'));
    this.#placeQueued();
  }

  #end(slot: WorkerSlot): void {
    slot.end();
    this.#slots.delete(slot);
    for (const [name, keeper] of this.#keepers) if (keeper === slot) this.#keepers.delete(name);
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

/** Returns the error for a request whose workers did not respond, in browsers that do not report the end of a worker. */
function silent(ms: number, isReading: boolean): GaussianSplatError {
  return new GaussianSplatError('network/interrupted', {
    where: 'scene worker',
    expected: 'a worker that responds, or a browser that reports its end',
    found: `none for ${ms / 1000} s, ${isReading ? 'while it read the scene' : 'and no scene that it was reading'}`,
    remedy: 'load the scene again when the machine is less busy, or use a smaller one',
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
