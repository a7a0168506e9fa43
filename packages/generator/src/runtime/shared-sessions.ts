import type { StartWorker } from '../proof/run-on-cpu.js';
import { GeneratorSession } from './generator-session.js';
import type { FetchOptions } from './fetch-bytes.js';
import { openModel, type ModelSource } from './open-model.js';

/** A reference to a shared session. */
export interface SessionLease {
  readonly session: GeneratorSession;
  /** Releases the reference; the last one releases the session. Further calls have no effect. */
  release(): void;
}

interface Entry {
  users: number;
  readonly abort: AbortController;
  readonly session: Promise<GeneratorSession>;
  /** Whether it is unusable for all users. */
  readonly hasGivenUp: () => boolean;
  readonly fallbackListeners: Set<(reason: string) => void>;
  fallback: string | undefined;
}

const devices = new WeakMap<GPUDevice, Map<string, Entry>>();

export interface AcquireOptions extends Pick<FetchOptions, 'signal' | 'onProgress'> {
  /** Called with the reason when the model runs on the CPU. */
  readonly onFallback?: (reason: string) => void;
  /**
   * Whether the output of the first run on the GPU is compared with that on the CPU: in a worker, when the page is
   * idle, once for each model and adapter. If they differ the model runs on the CPU from then on. Default true; of
   * several users of a model the first one's value applies. A function starts the worker: see {@link StartWorker}.
   */
  readonly compare?: boolean | StartWorker;
}

/**
 * Returns the session of a generator on a device, shared by all users with the same address and contract.
 * @throws as `openModel` does.
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
  // A new request may find another file at the address.
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
    // The next request tries again.
    if (!options.signal?.aborted && entries.get(key) === shared) entries.delete(key);
    release();
    throw error;
  }
}

function open(source: ModelSource, device: GPUDevice, { onProgress, compare }: AcquireOptions): Entry {
  const abort = new AbortController();
  const fallbackListeners: Entry['fallbackListeners'] = new Set();
  const onFallback = (reason: string): void => {
    entry.fallback = reason;
    for (const listener of fallbackListeners) listener(reason);
  };
  let opened: GeneratorSession | undefined;
  const session = openModel(source, { onProgress, signal: abort.signal }).then(
    (model) => (opened = new GeneratorSession(model, device, onFallback, compare)),
  );
  const hasGivenUp = (): boolean => opened?.hasGivenUp ?? false;
  const entry: Entry = { users: 0, abort, session, hasGivenUp, fallbackListeners, fallback: undefined };
  return entry;
}

function keyOf({ url, contract, credentials }: ModelSource): string {
  return JSON.stringify([new URL(url, globalThis.location?.href).href, contract ?? null, credentials ?? null]);
}

/** Rejects with the signal's reason as soon as it aborts. */
function unlessAborted<T>(promise: Promise<T>, signal: AbortSignal | undefined): Promise<T> {
  if (signal === undefined) return promise;
  return new Promise((resolve, reject) => {
    const stop = (): void => reject(signal.reason);
    signal.addEventListener('abort', stop, { once: true });
    void promise.then(resolve, reject).finally(() => signal.removeEventListener('abort', stop));
  });
}
