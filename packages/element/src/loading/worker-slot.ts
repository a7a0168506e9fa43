import type { PageMessage, PartListener, PreviewListener, ProgressListener, WorkerRequest } from './protocol.js';

/** A request to a worker. */
export interface Job {
  readonly id: number;
  readonly request: WorkerRequest;
  readonly onProgress?: ProgressListener | undefined;
  readonly onPreview?: PreviewListener | undefined;
  readonly onPart?: PartListener | undefined;
  /** Buffers of the request, which can then be sent only once. */
  readonly transfer?: Transferable[] | undefined;
  /** Runs the request on the main thread. */
  readonly here: () => Promise<unknown>;
  readonly resolve: (answer: unknown) => void;
  readonly reject: (reason: unknown) => void;
  /** Number of restarts. */
  moves: number;
  slot?: WorkerSlot | undefined;
}

/** A worker, and its requests. */
export class WorkerSlot {
  readonly worker: Worker;
  readonly jobs = new Map<number, Job>();
  /** Functions that end the helpers of a job. */
  readonly helpers = new Map<number, () => void>();
  isReady = false;
  isLate = false;
  /** Number of missed pings. */
  missed = 0;
  /** The request that it is reading, which alone keeps it from responding. */
  reading: number | undefined;
  startTimer: ReturnType<typeof setTimeout> | undefined;
  #idleTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(worker: Worker) {
    this.worker = worker;
  }

  /** Whether pings are useful. */
  get isAsked(): boolean {
    return this.isReady && (this.jobs.size > 0 || this.reading !== undefined);
  }

  /** The job that it reads, unless that was canceled. */
  get reader(): Job | undefined {
    return this.reading === undefined ? undefined : this.jobs.get(this.reading);
  }

  /**
   * A job that cannot restart, or has restarted, does not share its worker; nor does a worker that reads a canceled job
   * get another.
   */
  mayTake(job: Job): boolean {
    const jobs = [...this.jobs.values()];
    const isLeft = this.reading !== undefined && !this.reader;
    return !isLeft && (jobs.length === 0 || ![job, ...jobs].some(({ transfer, moves }) => transfer || moves > 0));
  }

  take(job: Job): void {
    clearTimeout(this.#idleTimer);
    job.slot = this;
    this.jobs.set(job.id, job);
    if (this.isReady) this.#send(job);
  }

  /** Call when the script has started. */
  begin(): void {
    clearTimeout(this.startTimer);
    this.isReady = true;
    this.isLate = false;
    for (const job of this.jobs.values()) this.#send(job);
  }

  /** Call when the job is done or canceled. */
  drop(job: Job): void {
    job.slot = undefined;
    this.helpers.get(job.id)?.();
    this.helpers.delete(job.id);
    if (this.jobs.delete(job.id) && this.isReady) this.post({ type: 'cancel', id: job.id });
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
    this.worker.terminate();
    for (const stop of this.helpers.values()) stop();
  }

  #send({ id, request, transfer }: Job): void {
    this.post({ ...request, id }, transfer);
  }
}
