/**
 * The module of the worker that loads scenes. If a page does not allow workers, the page imports this module and calls
 * {@link runOnPage} itself. The module then adds no message listener.
 */
import type { BlockBuffers } from '@gaussian-splat/renderer/tools';
import { named } from './load-helpers.js';
import { buffersOf, HANDED_ON, type FileRequest, type ScenePart, type TaskListeners } from './protocol.js';
import type { PageMessage, TaskMessage, WorkerMessage } from './worker-messages.js';
import { runOnPage, runTask, WORKER_TASKS, type WorkerTask } from './worker-tasks.js';

export { runOnPage };

/** Smallest file that is handed on while the worker downloads others, bytes: smaller ones are read in milliseconds. */
const MIN_HANDED_BYTES = 1 << 18;

/** The members of a worker's global scope that are used here; TypeScript's DOM types lack them. */
interface WorkerScope {
  postMessage(message: WorkerMessage, transfer?: Transferable[]): void;
  addEventListener(type: 'message', listener: (event: MessageEvent<PageMessage>) => void): void;
}

/** A request that the worker is processing. */
interface Work {
  readonly abort: AbortController;
  /** Called with a port to each worker that helps with the request. */
  onHelper?: (port: MessagePort) => void;
  /** Functions that are called with the returned buffers of the parts of the scene, in the order of the parts. */
  readonly taken: ((buffers: BlockBuffers | undefined) => void)[];
}

function serve(scope: WorkerScope): void {
  const running = new Map<number, Work>();
  /** Functions that release the locks of this thread, by their names. */
  const locks = new Map<string, () => void>();

  const listenersOf = (id: number, work: Work, { wantsPreviews, wantsParts }: TaskMessage): TaskListeners => ({
    onProgress: (loaded, total) => scope.postMessage({ type: 'progress', id, loaded, total }),
    onPreview: wantsPreviews
      ? (scene) => scope.postMessage({ type: 'preview', id, scene }, buffersOf(scene.packed))
      : undefined,
    onPart: wantsParts ? (part) => sendPart(id, work, part) : undefined,
    onReading: (isReading) => scope.postMessage({ type: isReading ? 'reading' : 'rested', id }),
    handOn: (bytes) => {
      const isBusy = running.size > 1 && bytes.length >= MIN_HANDED_BYTES;
      if (isBusy) scope.postMessage({ type: 'downloaded', id, file: new Blob([bytes as Uint8Array<ArrayBuffer>]) });
      return isBusy;
    },
    askForHelp: (max, onHelper) => {
      work.onHelper = onHelper;
      scope.postMessage({ type: 'help', id, max });
    },
  });

  /** Sends a part of a scene. Resolves with its buffers when the page returns them; rejects if the request is canceled. */
  function sendPart(id: number, { taken, abort }: Work, part: ScenePart): Promise<BlockBuffers | undefined> {
    scope.postMessage({ type: 'part', id, part }, 'portion' in part ? buffersOf(part.portion) : []);
    const using = new Promise<BlockBuffers | undefined>((resolve, reject) => {
      taken.push(resolve);
      abort.signal.addEventListener('abort', () => reject(abort.signal.reason as Error), { once: true });
    });
    // Not every sender waits.
    using.catch(() => undefined);
    return using;
  }

  /**
   * Runs a request, and posts its answer or its error. Errors without a code get one. Canceled requests are not
   * answered.
   */
  async function run(message: TaskMessage): Promise<void> {
    const { id, type } = message;
    const work = running.get(id)!;
    const { signal } = work.abort;
    const { transfer, isResponsive } = WORKER_TASKS[type] as WorkerTask<never, unknown>;
    try {
      signal.throwIfAborted();
      if (!isResponsive) scope.postMessage({ type: 'reading', id });
      const answer: unknown = await runTask(
        type,
        fetchable(message.request) as never,
        signal,
        listenersOf(id, work, message),
      );
      if (!signal.aborted) scope.postMessage({ type: 'answer', id, answer }, transfer?.(answer));
    } catch (error) {
      if (!signal.aborted && error !== HANDED_ON)
        scope.postMessage({ type: 'error', id, error: named(error, 'scene worker').toData() });
    } finally {
      running.delete(id);
      scope.postMessage({ type: 'rested', id });
    }
  }

  function hold(name: string): void {
    const released = new Promise<void>((resolve) => locks.set(name, resolve));
    const onHeld = (): Promise<void> => {
      scope.postMessage({ type: 'holds', name });
      return released;
    };
    // Pages without an origin have no locks, and their workers do not even have the object.
    (navigator as Partial<Navigator>).locks
      ?.request(name, onHeld)
      .catch(() => undefined)
      .finally(() => locks.delete(name));
  }

  scope.addEventListener('message', ({ data }) => {
    if (data.type === 'hold') hold(data.name);
    else if (data.type === 'release') locks.get(data.name)?.();
    else if (data.type === 'ping') scope.postMessage({ type: 'pong' });
    else if (data.type === 'cancel') running.get(data.id)?.abort.abort();
    else if (data.type === 'taken') running.get(data.id)?.taken.shift()?.(data.buffers);
    else if (data.type === 'helper') running.get(data.id)?.onHelper?.(data.port);
    else if (data.type === 'pack') serveWith(import('./pack-rows.js'), ({ packRows }) => packRows(data.port));
    else if (data.type === 'sort')
      serveWith(import('./sort-splats.js'), ({ sortSplats }) => sortSplats(data.port, data.positions, data.areas));
    else if (data.type === 'run-on-cpu')
      serveWith(import('@gaussian-splat/generator'), ({ handleCpuRun }) => handleCpuRun(data));
    // A request that was canceled while this thread was busy is dropped, and fetches nothing.
    else {
      const { id } = data;
      running.set(id, { abort: new AbortController(), taken: [] });
      setTimeout(() => void run(data));
    }
  });
  scope.postMessage({ type: 'ready' });
}

/**
 * Returns a request with an address that this thread can fetch: a new one, if the page has sent the content of the file.
 * Its fragment contains the name of the file.
 */
function fetchable<T extends object>(request: T): T {
  const { file, url } = request as Partial<FileRequest>;
  return file && url ? { ...request, url: URL.createObjectURL(file) + new URL(url).hash } : request;
}

/**
 * Runs code in a worker that has no other purpose. A failure to load the code is thrown from a timer, because only then
 * does the worker's owner receive an `error` event.
 */
function serveWith<T>(code: Promise<T>, serve: (code: T) => unknown): void {
  code.then(serve, (error: unknown) =>
    setTimeout(() => {
      throw error;
    }),
  );
}

const isWorker = typeof document === 'undefined' && 'WorkerGlobalScope' in globalThis;
if (isWorker) serve(globalThis as unknown as WorkerScope);
