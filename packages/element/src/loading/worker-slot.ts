import type { PartListener, PreviewListener, ProgressListener } from './protocol.js';
import type { PageMessage, WorkerRequest } from './worker-messages.js';

/** A request to a worker, with its listeners. */
export interface Job {
  readonly id: number;
  /** The request; with the downloaded file, if a worker has handed it on. */
  request: WorkerRequest;
  /** Signal that cancels the request. */
  readonly signal: AbortSignal;
  readonly onProgress?: ProgressListener | undefined;
  readonly onPreview?: PreviewListener | undefined;
  readonly onPart?: PartListener | undefined;
  /** Buffers that are transferred with the request. A request with such buffers can be sent only once. */
  readonly transfer?: Transferable[] | undefined;
  /** Name of files whose parts one worker keeps for several requests. They are assigned to it while it responds. */
  readonly keeper?: string | undefined;
  /** Runs the request on the main thread. */
  readonly here: (request: WorkerRequest) => Promise<unknown>;
  readonly resolve: (answer: unknown) => void;
  readonly reject: (reason: unknown) => void;
  /**
   * Number of restarts of the request in another worker. A restart because the worker died while it read the request
   * counts more than 1.
   */
  moves: number;
  /** Time when the request was sent to its worker, in milliseconds of `performance.now()`. */
  sentAt: number;
  slot?: WorkerSlot | undefined;
  /** Number of workers that the request has yielded to others: see `FairTurns`. */
  turns?: number;
}

/** Returns whether the file of a job is downloaded, so that its worker only reads. */
export const isDownloaded = ({ request: { request } }: Job): boolean =>
  'downloaded' in ((request as object | null) ?? {});

/** Returns whether a job shares no worker: it cannot restart, has restarted, or reads for long. */
const isAlone = (job: Job): boolean => job.transfer !== undefined || job.moves > 0 || isDownloaded(job);

/** A worker, and the requests that it has been assigned. */
export class WorkerSlot {
  readonly worker: Worker;
  readonly jobs = new Map<number, Job>();
  /** Functions that terminate the helpers of a job, by the number of the job. */
  readonly helpers = new Map<number, () => void>();
  isReady = false;
  isLate = false;
  /** Number of intervals without a message of the worker since a ping. */
  missed = 0;
  /** Time of the last ping that the worker has answered: it has received what was sent before. */
  heardAt = 0;
  /** Time of the last ping. */
  pingedAt = 0;
  /** Number of the request that the worker is reading, which keeps it from responding; undefined if it reads none. */
  reading: number | undefined;
  startTimer: ReturnType<typeof setTimeout> | undefined;
  #idleTimer: ReturnType<typeof setTimeout> | undefined;
  readonly #onEnd: () => void;
  /** Name of the lock that the worker has while it has jobs, so that pages without loads can be cached when left. */
  #lock: string | undefined;
  /** Ends the wait for the lock; undefined until the worker holds it. */
  #waiting: AbortController | undefined;

  /** @param onEnd Called when the browser has ended the worker's thread while it had jobs. */
  constructor(worker: Worker, onEnd: () => void) {
    this.worker = worker;
    this.#onEnd = onEnd;
  }

  /** Whether the worker must be pinged: it has started, and has work. */
  get isAsked(): boolean {
    return this.isReady && (this.jobs.size > 0 || this.reading !== undefined);
  }

  /** The job that the worker is reading; undefined if it reads none, or a canceled one. */
  get reader(): Job | undefined {
    return this.reading === undefined ? undefined : this.jobs.get(this.reading);
  }

  /** Whether the end of the worker's thread is reported. If it is not, only silence shows it. */
  get reportsEnd(): boolean {
    return this.#waiting !== undefined;
  }

  /**
   * Returns whether the worker may take a job. Some jobs share no worker. A worker that reads a scene, or a canceled
   * job, gets no other job.
   */
  mayTake(job: Job): boolean {
    const jobs = [...this.jobs.values()];
    const isBusy = this.reading !== undefined && (!this.reader || this.reader.request.type === 'load');
    return !isBusy && !this.isLate && (jobs.length === 0 || ![job, ...jobs].some(isAlone));
  }

  take(job: Job): void {
    clearTimeout(this.#idleTimer);
    job.slot = this;
    this.jobs.set(job.id, job);
    if (this.isReady) this.#send(job);
  }

  /** Call when the worker's script has started. Sends all assigned jobs. */
  begin(): void {
    clearTimeout(this.startTimer);
    this.isReady = true;
    this.isLate = false;
    for (const job of this.jobs.values()) this.#send(job);
  }

  /** Call when a job is done, canceled or moved. Ends its helpers, and cancels its work in the worker. */
  drop(job: Job): void {
    job.slot = undefined;
    this.helpers.get(job.id)?.();
    this.helpers.delete(job.id);
    if (this.jobs.delete(job.id) && this.isReady) this.post({ type: 'cancel', id: job.id });
    if (this.jobs.size === 0) this.#release();
  }

  /** Call when the worker holds a lock. Browsers release it when they end its thread. */
  held(name: string): void {
    if (name !== this.#lock) return;
    const { signal } = (this.#waiting = new AbortController());
    navigator.locks.request(name, { signal }, this.#onEnd).catch(() => undefined);
  }

  #release(): void {
    this.#waiting?.abort();
    this.#waiting = undefined;
    if (this.#lock !== undefined) this.post({ type: 'release', name: this.#lock });
    this.#lock = undefined;
  }

  rest(milliseconds: number, onIdle: () => void): void {
    clearTimeout(this.#idleTimer);
    this.#idleTimer = setTimeout(onIdle, milliseconds);
  }

  post(message: PageMessage, transfer: Transferable[] = []): void {
    this.worker.postMessage(message, transfer);
  }

  end(): void {
    clearTimeout(this.#idleTimer);
    clearTimeout(this.startTimer);
    this.#release();
    this.worker.terminate();
    for (const stop of this.helpers.values()) stop();
  }

  #send(job: Job): void {
    const { id, request, transfer, onPreview, onPart } = job;
    job.sentAt = performance.now();
    // Only secure contexts have locks.
    if (this.#lock === undefined && (navigator as Partial<Navigator>).locks) {
      this.#lock = `gaussian-splat ${crypto.randomUUID()}`;
      this.post({ type: 'hold', name: this.#lock });
    }
    this.post({ ...request, id, wantsPreviews: onPreview !== undefined, wantsParts: onPart !== undefined }, transfer);
  }
}
