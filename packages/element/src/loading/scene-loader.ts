import { loadModule } from '@gaussian-splat/core';
import { why } from '../gpu/request-device.js';
import type { FileRequest, LoadedScene, PreviewListener, ProgressListener, SceneRequest } from './protocol.js';
import type * as workerModule from './scene-worker.js';
import type { WorkerRequest } from './worker-messages.js';
import { WORKER_SOURCES } from './worker-sources.js';
import { spawnAt } from './spawn-worker.js';
import { WorkerPool } from './worker-pool.js';
import type { AnswerOf, RequestOf, TaskType } from './worker-tasks.js';

/**
 * Loads scenes in workers. One worker serves the whole page: it starts with the first load and ends when idle. More
 * workers are started only if it does not respond.
 */
export class SceneLoader {
  /** Starts a worker that the caller owns and must terminate. */
  readonly spawn: () => Worker;
  readonly #pool: WorkerPool;
  /** Index in {@link WORKER_SOURCES} of the current way to start a worker. */
  #way = 0;
  /** The directive of the page's Content-Security-Policy that has blocked a worker. */
  #violated: string | undefined;

  /**
   * @param spawn Starts a worker; default: the package's own. Tests pass another function.
   * @param locationOf Returns the address of the worker's script; null for the element's own.
   */
  constructor(spawn?: () => Worker, locationOf: () => string | null = () => null) {
    this.spawn = spawn ?? (() => this.#spawnAt(locationOf()));
    this.#pool = new WorkerPool(
      this.spawn,
      () => this.#code(),
      (reason, isLate) => void this.#warn(reason, locationOf(), isLate),
      () => !spawn && locationOf() === null && ++this.#way < WORKER_SOURCES.length,
    );
  }

  #spawnAt(location: string | null): Worker {
    document.addEventListener('securitypolicyviolation', this.#note);
    return location === null ? WORKER_SOURCES[this.#way]() : spawnAt(new URL(location, document.baseURI));
  }

  async #warn(reason: string, location: string | null, isLate: boolean): Promise<void> {
    try {
      const { warnOfRefusal } = await import('./refusal.js');
      warnOfRefusal(reason, this.#violated, location, isLate);
    } catch {
      console.warn(reason);
    }
  }

  readonly #note = ({ effectiveDirective }: SecurityPolicyViolationEvent): void => {
    if (effectiveDirective === 'worker-src') this.#violated = effectiveDirective;
  };

  /**
   * Fetches, reads and packs a scene. Rejects with GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or
   * with the signal's reason as soon as the signal is aborted.
   *
   * @param onPreview Called with previews of a large scene before it is complete; never after the promise has settled.
   */
  async load(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene> {
    const loaded = await this.ask('load', request, signal, { onProgress, onPreview });
    if ('frames' in loaded) throw await why(({ sequenceWithin }) => sequenceWithin(request.url));
    // Without `onPart`, the answer contains the splats.
    return loaded as LoadedScene;
  }

  /** Fetches the bytes of one file. Rejects as {@link ask} does. */
  fetchFile(request: FileRequest, signal: AbortSignal, onProgress?: ProgressListener): Promise<ArrayBuffer> {
    return this.ask('file', request, signal, { onProgress });
  }

  /**
   * Runs a task in a worker, or on the main thread if workers are not available. Rejects with GaussianSplatError
   * (`network/*`, `decode/*`, `out-of-memory/*`), or with the signal's reason as soon as the signal is aborted.
   * @returns the answer of the task: see `WORKER_TASKS`; undefined for tasks that run only in workers, without one.
   */
  ask<T extends TaskType>(
    type: T,
    request: RequestOf<T>,
    signal: AbortSignal,
    options: Parameters<WorkerPool['run']>[3] = {},
  ): Promise<AnswerOf<T>> {
    const { onProgress = () => undefined, onPreview } = options;
    const here = async (asked: WorkerRequest): Promise<AnswerOf<T>> =>
      (await this.#code()).runOnPage(type, asked.request as RequestOf<T>, signal, { onProgress, onPreview });
    const run = (asked: RequestOf<T>): Promise<AnswerOf<T>> =>
      this.#pool.run({ type, request: asked } as WorkerRequest, signal, here, options);
    return origin === 'null' ? withFile(request).then(run) : run(request);
  }

  async #code(): Promise<typeof workerModule> {
    try {
      return await loadModule('the code that reads scenes', () => import('./scene-worker.js'));
    } catch (error) {
      // If the code cannot be loaded on the main thread either, the page's policy was not the cause, so workers are
      // tried again.
      this.#way = 0;
      this.#pool.retry();
      throw error;
    }
  }
}

/**
 * Adds the content of a `blob:` address to a request. Workers cannot read such addresses of pages without an origin,
 * which are opened from a disk or in a sandboxed frame.
 */
async function withFile<T>(request: T): Promise<T> {
  const { url } = request as Partial<FileRequest>;
  if (!url?.startsWith('blob:')) return request;
  const file = await fetch(url).then(
    (response) => response.blob(),
    () => undefined,
  );
  return { ...request, file };
}
