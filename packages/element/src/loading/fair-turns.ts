import type { FileRequest } from './protocol.js';
import type { WorkerRequest } from './worker-messages.js';
import type { Job, WorkerSlot } from './worker-slot.js';

/** Worker time that a source gets before those that have had less come first, ms. */
const FIRST_MS = 1_000;
/** Minimum reading time before a request may lose its worker to a source without any, in ms. It doubles each time. */
const TURN_MS = 2_000;

/**
 * Divides the workers of a page among its scenes, so that scenes that are read for a long time delay no other. Sources are
 * elements and children: parts of a clip, and boxes of a streamed scene, belong to the same one.
 */
export class FairTurns {
  /** Reading time of each source, ms. */
  readonly #spent = new Map<string, number>();

  /** Call at intervals of `ms` for a worker that does not respond while it reads a request. */
  count({ request }: Job, ms: number): void {
    const source = sourceOf(request);
    this.#spent.set(source, this.#spentOn(request) + ms);
  }

  /** Returns whether a request is of a source that has had little worker time. */
  isNew({ request }: Job): boolean {
    return this.#spentOn(request) < FIRST_MS;
  }

  /** Sorts waiting requests: those of sources that have had the least worker time come first. */
  sort(queue: Job[]): Job[] {
    return queue.sort((a, b) => this.#spentOn(a.request) - this.#spentOn(b.request));
  }

  /**
   * Returns the worker that a new source gets if all are occupied: the one that has read a request for longest, and longer
   * than the turn of that request. Undefined if there is none. A request that cannot restart keeps its worker.
   */
  slotFor(job: Job, slots: Iterable<WorkerSlot>, silentMs: (slot: WorkerSlot) => number): WorkerSlot | undefined {
    if (!this.isNew(job)) return undefined;
    const over = [...slots].filter((slot) => {
      const { reader } = slot;
      const hasFixed = [...slot.jobs.values()].some(({ transfer }) => transfer);
      return reader && !hasFixed && !this.isNew(reader) && silentMs(slot) >= TURN_MS * 2 ** (reader.turns ?? 0);
    });
    return over.sort((a, b) => silentMs(b) - silentMs(a))[0];
  }

  #spentOn(request: WorkerRequest): number {
    return this.#spent.get(sourceOf(request)) ?? 0;
  }
}

/** Returns the source of a request: its number, else its address, else its type. */
function sourceOf(asked: WorkerRequest): string {
  const { request } = asked as { readonly request?: Partial<FileRequest> & { readonly place?: object } };
  const place = request?.place as { readonly url?: string } | undefined;
  return String(request?.source ?? request?.url ?? place?.url ?? asked.type);
}
