import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import type { PackedGaussians, PackedLevels } from '@gaussian-splat/renderer';
import { buffersOf } from './buffers-of.js';
import type {
  BoxRequest,
  FileRequest,
  LoadedBoxes,
  LoadedScene,
  LoadedSequence,
  PageMessage,
  PreviewListener,
  ProgressListener,
  SceneRequest,
  WorkerMessage,
} from './protocol.js';
import type * as workerModule from './scene-worker.js';
import { spawnSceneWorker } from './spawn-worker.js';

/** An unused worker is kept this long: pages with several elements load one scene after another. */
const IDLE_MS = 5_000;
/** And one that has fetched for a streamed scene this long: its camera may move again at any time. */
const STREAMING_IDLE_MS = 60_000;

interface Listeners {
  readonly onProgress?: ProgressListener;
  readonly onPreview?: PreviewListener | undefined;
}

/** The worker's code. */
type Here = typeof workerModule;

/** What streamed scenes ask for. */
type Request =
  | { readonly type: 'file'; readonly request: FileRequest }
  | { readonly type: 'boxes'; readonly request: SceneRequest }
  | { readonly type: 'box'; readonly request: BoxRequest };

interface Pending extends Listeners {
  /** Gets what the worker answered: a scene, a sequence, levels or a file, as was asked for. */
  readonly resolve: (answer: never) => void;
  readonly reject: (reason: unknown) => void;
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

  readonly #locationOf: () => string | null;

  /**
   * @param spawn starts the worker; tests pass their own
   * @param locationOf address of the worker's script; null for the one beside the code
   */
  constructor(spawn?: () => Worker, locationOf: () => string | null = () => null) {
    this.#locationOf = locationOf;
    this.#spawn = spawn ?? (() => spawnSceneWorker(locationOf()));
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
    const worker = await this.#workerFor(signal);
    if (worker === null) return this.#loadHere(request, signal, onProgress, onPreview);
    const id = this.#nextId++;
    const message: PageMessage = { type: 'load', id, request, wantsPreviews: onPreview !== undefined };
    return this.#ask<LoadedScene | LoadedSequence>(worker, message, signal, { onProgress, onPreview });
  }

  /** The bytes of one file. Rejects with GaussianSplatError `network/*`, `out-of-memory/allocation`, or with the signal's reason as soon as that is aborted. */
  fetchFile(request: FileRequest, signal: AbortSignal): Promise<ArrayBuffer> {
    return this.#do({ type: 'file', request }, signal, (here) => here.fetchFile(request, signal));
  }

  /** The coarsest levels of a streamed SOG scene. Rejects as {@link load} does. */
  openBoxes(request: SceneRequest, signal: AbortSignal, onProgress: ProgressListener): Promise<LoadedBoxes> {
    const here = (worker: Here): Promise<LoadedBoxes> => worker.openBoxes(request, signal, onProgress);
    return this.#do({ type: 'boxes', request }, signal, here, { onProgress });
  }

  /** The words of a level of a box of it. Rejects as {@link load} does. */
  readBox(request: BoxRequest, signal: AbortSignal): Promise<ArrayBuffer> {
    return this.#do({ type: 'box', request }, signal, (here) => here.readBox(request, signal));
  }

  /**
   * Builds the levels of detail of a packed scene, whose arrays are the worker's afterwards; undefined for one that is too small to have any, and where the page
   * refuses workers: its own thread would stand still for seconds. Rejects with GaussianSplatError `out-of-memory/allocation` or the signal's reason.
   */
  async buildLevels(packed: PackedGaussians, signal: AbortSignal): Promise<PackedLevels | undefined> {
    const worker = await this.#workerFor(signal);
    if (worker === null) return undefined;
    const message: PageMessage = { type: 'levels', id: this.#nextId++, packed };
    return this.#ask<PackedLevels | undefined>(worker, message, signal, {}, buffersOf(packed));
  }

  /** Has a request answered by the worker, or by its code on the page's own thread. */
  async #do<T>(
    request: Request,
    signal: AbortSignal,
    here: (worker: Here) => Promise<T>,
    listeners: Listeners = {},
  ): Promise<T> {
    const worker = await this.#workerFor(signal);
    if (worker === null) return here(await this.#codeHere());
    return this.#ask<T>(worker, { ...request, id: this.#nextId++ }, signal, listeners);
  }

  /** The worker, or null where this page may have none. Rejects with the signal's reason. */
  async #workerFor(signal: AbortSignal): Promise<Worker | null> {
    signal.throwIfAborted();
    clearTimeout(this.#idleTimer);
    const worker = await (this.#worker ??= this.#start());
    if (signal.aborted && worker) this.#rest(worker, IDLE_MS);
    signal.throwIfAborted();
    return worker;
  }

  /** With nothing to do for so long the worker ends. */
  #rest(worker: Worker, idleMs: number): void {
    if (this.#pending.size > 0) return;
    clearTimeout(this.#idleTimer);
    this.#idleTimer = setTimeout(() => this.#end(worker), idleMs);
  }

  /** Sends a request to the worker, and waits for its answer. */
  async #ask<T>(
    worker: Worker,
    message: PageMessage,
    signal: AbortSignal,
    listeners: Listeners,
    transfer: Transferable[] = [],
  ): Promise<T> {
    const { id } = message;
    const { promise, resolve, reject } = withResolvers<T>();
    const cancel = (): void => {
      worker.postMessage({ type: 'cancel', id } satisfies PageMessage);
      reject(signal.reason);
    };
    clearTimeout(this.#idleTimer);
    this.#pending.set(id, { resolve, reject, ...listeners });
    signal.addEventListener('abort', cancel, { once: true });
    worker.postMessage(message, transfer);
    try {
      return await promise;
    } finally {
      signal.removeEventListener('abort', cancel);
      this.#pending.delete(id);
      this.#rest(worker, /^(file|box)/.test(message.type) ? STREAMING_IDLE_MS : IDLE_MS);
    }
  }

  /** The worker's code on the page's own thread: slower for the page, but it works under any policy. */
  async #loadHere(
    request: SceneRequest,
    signal: AbortSignal,
    onProgress: ProgressListener,
    onPreview: PreviewListener | undefined,
  ): Promise<LoadedScene | LoadedSequence> {
    const { loadScene } = await this.#codeHere();
    return loadScene(request, signal, onProgress, onPreview);
  }

  /** Where the code cannot be had here, either, it was no policy of the page that kept the worker away: the next load tries again. */
  async #codeHere(): Promise<Here> {
    try {
      return await loadModule('the code that reads scenes', () => import('./scene-worker.js'));
    } catch (error) {
      this.#worker = null;
      throw error;
    }
  }

  /** The running worker, or null where this page may have none. */
  async #start(): Promise<Worker | null> {
    try {
      const worker = this.#spawn();
      await firstMessage(worker);
      worker.addEventListener('message', ({ data }: MessageEvent<WorkerMessage>) => this.#receive(data));
      worker.addEventListener('error', (event) => this.#crash(worker, event));
      this.#running = worker;
      return worker;
    } catch (error) {
      const reason = error instanceof Error ? error.message : String(error);
      console.warn(
        `<gaussian-splat>: this page refuses its worker (${reason}), so scenes are read on the main thread. ` +
          `Allow it with the Content-Security-Policy directive worker-src, or name its script (${this.#locationOf() ?? 'scene-worker.js beside the code'}) with GaussianSplatElement.workerLocation.`,
      );
      return null;
    }
  }

  #receive(message: WorkerMessage): void {
    if (message.type === 'ready') return;
    const pending = this.#pending.get(message.id);
    if (message.type === 'progress') pending?.onProgress?.(message.loaded, message.total);
    else if (message.type === 'preview') pending?.onPreview?.(message.scene);
    else if (message.type === 'scene') pending?.resolve(message.scene as never);
    else if (message.type === 'sequence') pending?.resolve(message.sequence as never);
    else if (message.type === 'levels') pending?.resolve(message.levels as never);
    else if (message.type === 'file') pending?.resolve(message.bytes as never);
    else if (message.type === 'boxes') pending?.resolve(message.boxes as never);
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
