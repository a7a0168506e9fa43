import type { PageMessage, PartListener, PreviewListener, ProgressListener, WorkerRequest } from './protocol.js';

/** What a worker is asked for. */
export interface Job {
  readonly id: number;
  readonly request: WorkerRequest;
  readonly onProgress?: ProgressListener | undefined;
  readonly onPreview?: PreviewListener | undefined;
  readonly onPart?: PartListener | undefined;
  /** Buffers that go with the request, which can then be sent only once. */
  readonly transfer?: Transferable[] | undefined;
  /** Does the work on the page's own thread. */
  readonly here: () => Promise<unknown>;
  readonly resolve: (answer: unknown) => void;
  readonly reject: (reason: unknown) => void;
  /** How often it has begun again. */
  moves: number;
  slot?: WorkerSlot | undefined;
}

/** A worker, and what it was asked for. */
export class WorkerSlot {
  readonly worker: Worker;
  readonly jobs = new Map<number, Job>();
  /** Ends the workers that help with a job. */
  readonly helpers = new Map<number, () => void>();
  isReady = false;
  isLate = false;
  /** Questions in a row without an answer. */
  missed = 0;
  /** What it has last said to read: that alone keeps it from answering. */
  reading: number | undefined;
  startTimer: ReturnType<typeof setTimeout> | undefined;
  #idleTimer: ReturnType<typeof setTimeout> | undefined;

  constructor(worker: Worker) {
    this.worker = worker;
  }

  /** Whether it is worth asking for a sign of life. */
  get isAsked(): boolean {
    return this.isReady && (this.jobs.size > 0 || this.reading !== undefined);
  }

  /** The job that it reads, unless that was called off. */
  get reader(): Job | undefined {
    return this.reading === undefined ? undefined : this.jobs.get(this.reading);
  }

  /** What cannot begin again, or has once, shares its worker with nothing else; nor is one given more that reads what nobody wants. */
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

  /** The script runs. */
  begin(): void {
    clearTimeout(this.startTimer);
    this.isReady = true;
    this.isLate = false;
    for (const job of this.jobs.values()) this.#send(job);
  }

  /** The job is done, or nobody wants it any more. */
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
