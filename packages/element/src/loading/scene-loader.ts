import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import type { DetailManifest, PackedGaussians, PackedLevels } from '@gaussian-splat/renderer';
import { buffersOf } from './buffers-of.js';
import type {
  BoxRequest,
  FileRequest,
  LoadedBoxes,
  LoadedScene,
  LoadedSequence,
  PreviewListener,
  ProgressListener,
  SceneRequest,
} from './protocol.js';
import type * as workerModule from './scene-worker.js';
import { spawnSceneWorker } from './spawn-worker.js';
import { WorkerPool } from './worker-pool.js';

/** The worker's code. */
type Here = typeof workerModule;

/** Loads scenes in workers: one for the whole page, started on the first load and ended when idle, and more only where that one does not answer. */
export class SceneLoader {
  readonly #pool: WorkerPool;

  /**
   * @param spawn starts a worker; tests pass their own
   * @param locationOf address of the worker's script; null for the one beside the code
   */
  constructor(spawn?: () => Worker, locationOf: () => string | null = () => null) {
    this.#pool = new WorkerPool(
      spawn ?? (() => spawnSceneWorker(locationOf())),
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
    if ('frames' in loaded) throw sequenceWithin(request.url);
    return loaded;
  }

  /** The same for an address that may name a sequence: then its manifest is what comes. */
  open(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene | LoadedSequence> {
    return this.#pool.run(
      { type: 'load', request, wantsPreviews: onPreview !== undefined },
      signal,
      this.#here(({ loadScene }) => loadScene(request, signal, { onProgress, onPreview })),
      { onProgress, onPreview },
    );
  }

  /** The bytes of one file. Rejects with GaussianSplatError `network/*`, `out-of-memory/allocation`, or with the signal's reason as soon as that is aborted. */
  fetchFile(request: FileRequest, signal: AbortSignal): Promise<ArrayBuffer> {
    return this.#pool.run(
      { type: 'file', request },
      signal,
      this.#here(({ fetchFile }) => fetchFile(request, signal)),
    );
  }

  /** The checked manifest of a streamed scene. Rejects as {@link load} does. */
  openManifest(request: FileRequest, signal: AbortSignal, onProgress: ProgressListener): Promise<DetailManifest> {
    return this.#pool.run(
      { type: 'manifest', request },
      signal,
      this.#here(({ openManifest }) => openManifest(request, signal, onProgress)),
      { onProgress },
    );
  }

  /** The coarsest levels of a streamed SOG scene. Rejects as {@link load} does. */
  openBoxes(request: SceneRequest, signal: AbortSignal, onProgress: ProgressListener): Promise<LoadedBoxes> {
    return this.#pool.run(
      { type: 'boxes', request },
      signal,
      this.#here(({ openBoxes }) => openBoxes(request, signal, onProgress)),
      { onProgress },
    );
  }

  /** The words of a level of a box of it. Rejects as {@link load} does. */
  readBox(request: BoxRequest, signal: AbortSignal): Promise<ArrayBuffer> {
    return this.#pool.run(
      { type: 'box', request },
      signal,
      this.#here(({ readBox }) => readBox(request, signal)),
    );
  }

  /**
   * Builds the levels of detail of a packed scene, whose arrays are the worker's afterwards; undefined for one that is too small to have any, and where the page
   * refuses workers: its own thread would stand still for seconds. Rejects with GaussianSplatError `out-of-memory/allocation` or the signal's reason.
   */
  buildLevels(packed: PackedGaussians, signal: AbortSignal): Promise<PackedLevels | undefined> {
    const here = async (): Promise<undefined> => undefined;
    return this.#pool.run<PackedLevels | undefined>({ type: 'levels', packed }, signal, here, {
      transfer: buffersOf(packed),
    });
  }

  /** Work with the worker's code on the page's own thread: slower for the page, but it works under any policy. */
  #here<T>(work: (code: Here) => Promise<T>): () => Promise<T> {
    return async () => work(await this.#code());
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

function sequenceWithin(url: string): GaussianSplatError {
  return new GaussianSplatError('decode/unsupported', {
    where: url,
    expected: 'a scene file',
    found: 'the manifest of a sequence',
    remedy: 'name scene files as frames of a sequence, not other sequences',
  });
}
