import type { StartWorker } from '../cpu-check/run-on-cpu.js';
import { GeneratorSession } from './generator-session.js';
import type { FetchOptions } from './fetch-bytes.js';
import { addressOf, openModel, type ModelSource } from './open-model.js';

/** A counted reference to a shared session. */
export interface SessionLease {
  readonly session: GeneratorSession;
  /** Releases the reference. Releasing the last one releases the session. Further calls have no effect. */
  release(): void;
}

interface Entry {
  users: number;
  readonly abort: AbortController;
  readonly session: Promise<GeneratorSession>;
  /** Whether the session is unusable for all users. */
  readonly hasGivenUp: () => boolean;
  readonly fallbackListeners: Set<(reason: string) => void>;
  fallback: string | undefined;
}

const devices = new WeakMap<GPUDevice, Map<string, Entry>>();

export interface AcquireOptions extends Pick<FetchOptions, 'signal' | 'onProgress'> {
  /** Called when the model runs on the CPU, with the reason in English. */
  readonly onFallback?: (reason: string) => void;
  /**
   * Whether the output of the first run on the GPU is compared with that on the CPU: in a worker, when the page is
   * idle, once for each model and adapter. If the outputs differ, the model runs on the CPU from then on. Default true.
   * If a model has several users, the value of the first applies. A function starts the worker: see {@link
   * StartWorker}.
   */
  readonly gpuCheck?: boolean | StartWorker;
}

/**
 * Returns a reference to the session of a generator on a device, shared by all users with the same URL and contract.
 * @throws the errors of `openModel`
 */
export async function acquireSession(
  source: ModelSource,
  device: GPUDevice,
  options: AcquireOptions = {},
): Promise<SessionLease> {
  options.signal?.throwIfAborted();
  const entries = devices.get(device) ?? new Map<string, Entry>();
  devices.set(device, entries);
  const key = keyOf(source);
  let entry = entries.get(key);
  // A session that is unusable is opened again, because there may be another file at the URL.
  if (entry === undefined || entry.hasGivenUp()) entries.set(key, (entry = open(source, device, options)));
  const shared = entry;
  const { onFallback = () => undefined } = options;
  shared.users++;
  shared.fallbackListeners.add(onFallback);
  if (shared.fallback !== undefined) onFallback(shared.fallback);
  let isReleased = false;
  const release = (): void => {
    if (isReleased) return;
    isReleased = true;
    shared.fallbackListeners.delete(onFallback);
    if (--shared.users > 0) return;
    if (entries.get(key) === shared) entries.delete(key);
    shared.abort.abort();
    void shared.session.then((session) => session.release()).catch(() => undefined);
  };
  try {
    const session = await unlessAborted(shared.session, options.signal);
    return { session, release };
  } catch (error) {
    // The next request opens the session again.
    if (!options.signal?.aborted && entries.get(key) === shared) entries.delete(key);
    release();
    throw error;
  }
}

function open(source: ModelSource, device: GPUDevice, { onProgress, gpuCheck }: AcquireOptions): Entry {
  const abort = new AbortController();
  const fallbackListeners: Entry['fallbackListeners'] = new Set();
  const onFallback = (reason: string): void => {
    entry.fallback = reason;
    for (const listener of fallbackListeners) listener(reason);
  };
  let opened: GeneratorSession | undefined;
  const session = openModel(source, { onProgress, signal: abort.signal }).then(
    (model) => (opened = new GeneratorSession(model, device, onFallback, gpuCheck)),
  );
  const hasGivenUp = (): boolean => opened?.hasGivenUp ?? false;
  const entry: Entry = { users: 0, abort, session, hasGivenUp, fallbackListeners, fallback: undefined };
  return entry;
}

function keyOf({ url, contract, credentials }: ModelSource): string {
  return JSON.stringify([addressOf(url), contract ?? null, credentials ?? null]);
}

/** Returns a promise like the given one that also rejects as soon as the signal is aborted, with its reason. */
function unlessAborted<T>(promise: Promise<T>, signal: AbortSignal | undefined): Promise<T> {
  if (signal === undefined) return promise;
  return new Promise((resolve, reject) => {
    const stop = (): void => reject(signal.reason);
    signal.addEventListener('abort', stop, { once: true });
    void promise.then(resolve, reject).finally(() => signal.removeEventListener('abort', stop));
  });
}
