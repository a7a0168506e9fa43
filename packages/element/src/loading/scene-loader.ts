import { GaussianSplatError } from '@gaussian-splat/core';
import type {
  LoadedScene,
  LoadedSequence,
  PageMessage,
  PreviewListener,
  ProgressListener,
  SceneRequest,
  WorkerMessage,
} from './protocol.js';
import { spawnSceneWorker } from './spawn-worker.js';

/** An unused worker is kept this long: pages with several elements load one scene after another. */
const IDLE_MS = 5_000;

interface Pending {
  readonly resolve: (scene: LoadedScene | LoadedSequence) => void;
  readonly reject: (reason: unknown) => void;
  readonly onProgress: ProgressListener;
  readonly onPreview: PreviewListener | undefined;
}

/** Loads scenes in one worker for the whole page, started on the first load and ended when idle. */
export class SceneLoader {
  readonly #spawn: () => Worker;
  readonly #pending = new Map<number, Pending>();
  #worker: Promise<Worker | null> | null = null;
  /** What {@link #worker} came to, while it runs. */
  #running: Worker | null = null;
  #nextId = 0;
  #idleTimer: ReturnType<typeof setTimeout> | undefined;
  #refused = false;

  /** @param spawn starts the worker; tests pass their own. */
  constructor(spawn: () => Worker = spawnSceneWorker) {
    this.#spawn = spawn;
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
  async open(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview?: PreviewListener,
  ): Promise<LoadedScene | LoadedSequence> {
    signal.throwIfAborted();
    clearTimeout(this.#idleTimer);
    const worker = await (this.#worker ??= this.#start());
    signal.throwIfAborted();
    if (worker === null) return this.#loadHere(request, signal, onProgress, onPreview);
    return this.#loadThere(worker, request, signal, onProgress, onPreview);
  }

  async #loadThere(
    worker: Worker,
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview: PreviewListener | undefined,
  ): Promise<LoadedScene | LoadedSequence> {
    const id = this.#nextId++;
    const post = (message: PageMessage): void => worker.postMessage(message);
    const { promise, resolve, reject } = withResolvers<LoadedScene | LoadedSequence>();
    const cancel = (): void => {
      post({ type: 'cancel', id });
      reject(signal.reason);
    };
    clearTimeout(this.#idleTimer);
    this.#pending.set(id, { resolve, reject, onProgress, onPreview });
    signal.addEventListener('abort', cancel, { once: true });
    post({ type: 'load', id, request, wantsPreviews: onPreview !== undefined });
    try {
      return await promise;
    } finally {
      signal.removeEventListener('abort', cancel);
      this.#pending.delete(id);
      if (this.#pending.size === 0) this.#idleTimer = setTimeout(() => this.#end(worker), IDLE_MS);
    }
  }

  /** The worker's code on the page's own thread: slower for the page, but it works under any policy. */
  async #loadHere(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview: PreviewListener | undefined,
  ): Promise<LoadedScene | LoadedSequence> {
    const { loadScene } = await import('./scene-worker.js');
    return loadScene(request, signal, onProgress, onPreview);
  }

  /** The running worker, or null where this page may have none. */
  async #start(): Promise<Worker | null> {
    if (this.#refused) return null;
    try {
      const worker = this.#spawn();
      await firstMessage(worker);
      worker.addEventListener('message', ({ data }: MessageEvent<WorkerMessage>) => this.#receive(data));
      worker.addEventListener('error', (event) => this.#crash(worker, event));
      this.#running = worker;
      return worker;
    } catch (error) {
      this.#refused = true;
      const reason = error instanceof Error ? error.message : String(error);
      console.warn(
        `<gaussian-splat>: this page refuses its worker (${reason}), so scenes are read on the main thread. ` +
          `Allow it with the Content-Security-Policy directive worker-src.`,
      );
      return null;
    }
  }

  #receive(message: WorkerMessage): void {
    if (message.type === 'ready') return;
    const pending = this.#pending.get(message.id);
    if (message.type === 'progress') pending?.onProgress(message.loaded, message.total);
    else if (message.type === 'preview') pending?.onPreview?.(message.scene);
    else if (message.type === 'scene') pending?.resolve(message.scene);
    else if (message.type === 'sequence') pending?.resolve(message.sequence);
    else pending?.reject(GaussianSplatError.fromData(message.error));
  }

  /** A worker that dies after it had started was most likely denied memory; the next load starts a new one. */
  #crash(worker: Worker, event: ErrorEvent): void {
    event.preventDefault();
    this.#end(worker);
    for (const { reject } of this.#pending.values()) {
      reject(
        new GaussianSplatError('out-of-memory/allocation', {
          where: 'scene worker',
          expected: 'a worker that finishes reading the scene',
          found: event.message || 'a worker that stopped',
          remedy: 'use a smaller scene, or close other pages',
        }),
      );
    }
  }

  /** Ends a worker; the next load starts another. */
  #end(worker: Worker): void {
    worker.terminate();
    if (this.#running !== worker) return;
    clearTimeout(this.#idleTimer);
    this.#running = null;
    this.#worker = null;
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

/** Settles with the worker's first message: only then has its script been allowed, fetched and run. */
function firstMessage(worker: Worker): Promise<void> {
  return new Promise((resolve, reject) => {
    worker.addEventListener('message', () => resolve(), { once: true });
    worker.addEventListener(
      'error',
      (event) => {
        event.preventDefault();
        reject(new Error(event.message || 'its script could not be loaded'));
      },
      { once: true },
    );
  });
}

/** `Promise.withResolvers`, which not every browser with WebGPU has. */
function withResolvers<T>(): {
  promise: Promise<T>;
  resolve: (value: T) => void;
  reject: (reason: unknown) => void;
} {
  let resolve!: (value: T) => void;
  let reject!: (reason: unknown) => void;
  const promise = new Promise<T>((yes, no) => {
    resolve = yes;
    reject = no;
  });
  return { promise, resolve, reject };
}
