import { loadModule } from '@gaussian-splat/core';
import { why } from '../gpu/request-device.js';
import type {
  FileRequest,
  LoadedScene,
  LoadedSequence,
  PreviewListener,
  ProgressListener,
  SceneRequest,
  WorkerRequest,
} from './protocol.js';
import type * as workerModule from './scene-worker.js';
import { spawnSceneWorker } from './spawn-worker.js';
import { WorkerPool } from './worker-pool.js';

/** The worker's code. */
export type Here = typeof workerModule;

/** Loads scenes in workers: one for the whole page, started on the first load and ended when idle, and more only where that one does not answer. */
export class SceneLoader {
  /** Starts a worker that is the caller's own. */
  readonly spawn: () => Worker;
  readonly #pool: WorkerPool;

  /**
   * @param spawn starts a worker; tests pass their own
   * @param locationOf address of the worker's script; null for the one beside the code
   */
  constructor(spawn?: () => Worker, locationOf: () => string | null = () => null) {
    this.spawn = spawn ?? (() => spawnSceneWorker(locationOf()));
    this.#pool = new WorkerPool(
      this.spawn,
      () => this.#code(),
      (reason) =>
        console.warn(
          `<gaussian-splat>: this page refuses its worker (${reason}), so scenes are read on the main thread. ` +
            `Allow it with the Content-Security-Policy directive worker-src, or name its script (${locationOf() ?? 'scene-worker.js beside the code'}) with GaussianSplatElement.workerLocation.`,
        ),
    );
  }

  /**
   * Fetches, reads and packs a scene. Rejects with GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or
   * with the signal's reason as soon as that is aborted.
   *
   * @param onPreview called with what can be shown of a large scene before it is whole; never after the promise has settled.
   */
  async load(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene> {
    const loaded = await this.open(request, signal, onProgress, onPreview);
    if ('frames' in loaded) throw await why(({ sequenceWithin }) => sequenceWithin(request.url));
    return loaded;
  }

  /** The same for an address that may name a sequence: then its manifest is what comes. */
  open(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene | LoadedSequence> {
    return this.ask(
      { type: 'load', request, wantsPreviews: onPreview !== undefined },
      signal,
      ({ loadScene }) => loadScene(request, signal, { onProgress, onPreview }),
      { onProgress, onPreview },
    );
  }

  /** The bytes of one file. Rejects with GaussianSplatError `network/*`, `out-of-memory/allocation`, or with the signal's reason as soon as that is aborted. */
  fetchFile(request: FileRequest, signal: AbortSignal): Promise<ArrayBuffer> {
    return this.ask({ type: 'file', request }, signal, ({ fetchFile }) => fetchFile(request, signal));
  }

  /**
   * Has a worker do what it knows: see `WorkerRequest`. Rejects as {@link load} does.
   * @param here does it on the page's own thread, where workers are refused
   */
  ask<T>(
    request: WorkerRequest,
    signal: AbortSignal,
    here: (code: Here) => Promise<T>,
    options?: Parameters<WorkerPool['run']>[3],
  ): Promise<T> {
    return this.#pool.run(request, signal, async () => here(await this.#code()), options);
  }

  async #code(): Promise<Here> {
    try {
      return await loadModule('the code that reads scenes', () => import('./scene-worker.js'));
    } catch (error) {
      // Where it cannot be had here, either, it was no policy of the page that kept the worker away.
      this.#pool.retry();
      throw error;
    }
  }
}
