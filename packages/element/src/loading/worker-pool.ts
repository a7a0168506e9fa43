import { GaussianSplatError, Lazy } from '@gaussian-splat/core';
import type { WorkerMessage, WorkerRequest } from './protocol.js';
import { WorkerSlot, type Job } from './worker-slot.js';

/** An unused worker is kept this long: pages with several elements load one scene after another. */
const IDLE_MS = 5_000;
/** And one that has fetched for a streamed scene this long: its camera may move again at any time. */
const STREAMING_IDLE_MS = 60_000;
/** How often a worker that has something to do is asked for a sign of life, ms. */
const TICK_MS = 100;
/** Questions in a row without an answer after which a worker gets nothing new. */
const BUSY = 2;
/** And after which what else waits in it begins again elsewhere, and a worker whose load was called off is ended. */
const SILENT = 5;
/** And after which it counts as dead, whatever it was said to read: browsers do not tell. */
const DEAD = 600;
/** A script that takes longer is loaded without the worker, ms. */
const START_MS = 2_000;
const RESTART_MS = 15_000;
/** How long it is waited for once more when all that is needed without it is there, ms. */
const GRACE_MS = 500;
/** Workers of a page at most. Scenes of strangers that never end hold one each; what comes after them waits. */
const MOST_WORKERS = 8;
/** How often a load may begin again: it may have been next to several that never answer. */
const MOST_MOVES = 3;
/** So often counts a death while it was read: once more, and no more. */
const AFTER_DEATH = 2;

const help = new Lazy('the code that starts workers', () => import('./start-helpers.js'));

/** Why work is done on the page's thread. */
export type Refusal = (reason: string) => void;

/**
 * The workers of a page. One serves all loads while it answers. Where it does not, because it is reading a large or a hostile scene or has died, what else
 * waits in it begins again in another; work that was called off and does not stop is ended with its worker.
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
  /** The script has come once: where it does not come at once now, the machine is busy. */
  #hasStarted = false;
  #nextId = 0;
  #clock: ReturnType<typeof setInterval> | undefined;

  /**
   * @param prepare fetches what work on the page's own thread needs
   * @param onRefused called once where work is done there
   * @param another makes `spawn` start its workers in another way, after one has failed; false where there is none
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

  /** The next request asks for a worker again. */
  retry(): void {
    this.#isRefused = false;
  }

  /**
   * Has a request answered by a worker. Rejects with GaussianSplatError, or with the signal's reason as soon as that is aborted.
   * @param here does the work on the page's own thread, where workers are refused
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

  /** Gives a request to a worker that answers, or to a new one. */
  #place(job: Job): void {
    if (this.#isRefused) return job.resolve(job.here());
    const slots = [...this.#slots];
    const late = slots.find(({ isLate }) => isLate);
    if (late) return void this.#doWithout(late, job);
    const free = slots.find((slot) => slot.missed < BUSY && slot.mayTake(job));
    const slot = free ?? (slots.length < MOST_WORKERS ? this.#start() : undefined);
    // A worker that cannot even be made has said so.
    if (this.#isRefused) return job.resolve(job.here());
    if (!slot) return void this.#queue.push(job);
    slot.take(job);
    this.#watch();
  }

  #watch(): void {
    this.#clock ??= setInterval(this.#tick, TICK_MS);
  }

  /** Answered, failed or called off. */
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

  /** With nothing to do for so long the worker ends. */
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
    else if (job) this.#help(slot, job.id, message.most).catch(() => undefined);
  }

  /** Other workers for one that packs a large scene: they end with what they help with. Without their code it packs alone. */
  async #help(slot: WorkerSlot, id: number, most: number): Promise<void> {
    const { startHelpers } = await help.get();
    if (slot.jobs.has(id)) slot.helpers.set(id, startHelpers(slot.worker, id, most, this.#spawn));
  }

  /** The page may have no workers. */
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

  /** The worker's script does not come. It may yet. */
  #late(slot: WorkerSlot): void {
    slot.isLate = true;
    for (const job of slot.jobs.values()) {
      slot.jobs.delete(job.id);
      void this.#doWithout(slot, job);
    }
    this.#placeQueued();
  }

  /** The code may come for both: then the worker is a little later. */
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
      if (slot.missed >= SILENT) this.#relieve(slot);
      if (slot.missed++ === 0) slot.post({ type: 'ping' });
    }
    if (!isIdle) return;
    clearInterval(this.#clock);
    this.#clock = undefined;
  };

  /** What waits in a worker that does not answer begins again elsewhere. Without a load of its own it reads what nobody wants, or is dead. */
  #relieve(slot: WorkerSlot): void {
    const isDead = slot.missed >= DEAD;
    const reader = isDead ? undefined : slot.reader;
    const jobs = [...slot.jobs.values()].filter((job) => job !== reader);
    const guilty = slot.reader;
    if (!reader) this.#end(slot);
    for (const job of jobs) this.#move(slot, job, job === guilty ? AFTER_DEATH : 1);
    this.#placeQueued();
  }

  /** A load begins again, alone in a worker: it may be what has kept the other one busy. */
  #move(slot: WorkerSlot, job: Job, moves: number, found = 'a worker that gave no sign of life'): void {
    slot.drop(job);
    job.moves += moves;
    // What was given away cannot be given again.
    if (job.transfer || job.moves > MOST_MOVES) return job.reject(stopped(found));
    this.#place(job);
  }

  /** A worker that dies after it had started was most likely denied memory: by what it read, or by its only load. The others begin again. */
  #crash(slot: WorkerSlot, message: string): void {
    const jobs = [...slot.jobs.values()];
    const guilty = slot.reader ?? (jobs.length === 1 ? jobs[0] : undefined);
    this.#end(slot);
    for (const job of jobs)
      this.#move(slot, job, job === guilty ? MOST_MOVES + 1 : 1, message || 'a worker that stopped');
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
