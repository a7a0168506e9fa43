/**
 * The module of the worker that loads scenes. If a page does not allow workers, the page imports this module and calls
 * {@link loadScene} and the other functions itself. The module then adds no message listener.
 */
import { loadModule } from '@gaussian-splat/core';
import type { OpenedModel } from '@gaussian-splat/core/onnx';
import { fetchScene } from '@gaussian-splat/formats';
import type { DetailManifest } from '@gaussian-splat/renderer';
import type { BlockBuffers } from '@gaussian-splat/renderer/tools';
import {
  buffersOf,
  type BoxRequest,
  type ClipAnswer,
  type ClipRequest,
  type FileRequest,
  type FloorRequest,
  type LoadedBoxes,
  type LoadedMesh,
  type ModelRequest,
  type PageMessage,
  type ProgressListener,
  type ScenePart,
  type SceneRequest,
  type WorkerMessage,
  type WorkerRequest,
} from './protocol.js';
import { loadScene, named } from './load-scene.js';
import type * as boxes from './lod-boxes.js';
import type { FloorMap } from '@gaussian-splat/formats/floor';

export { loadScene };

/**
 * Fetches a file. Returns its bytes in a buffer of their own, or the decoded words of a coded file of pages. Throws
 * GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function fetchFile(
  { url, credentials, limits, coded }: FileRequest,
  signal: AbortSignal,
): Promise<ArrayBuffer> {
  const { maxBytes, maxSeconds } = limits ?? {};
  const bytes = await fetchScene(url, { mode: 'cors', credentials, signal, maxBytes, maxSeconds });
  if (coded === undefined) return bytes.slice().buffer;
  // This code has been loaded before, to read the manifest.
  const { decodePage } = await loadModule('the code that streams scenes', () => import('./open-manifest.js'));
  return decodePage(url, bytes as Uint8Array<ArrayBuffer>, coded);
}

const loadBoxCode = (): Promise<typeof boxes> =>
  loadModule('the code that streams SOG', () => import('./lod-boxes.js'));

export const openBoxes = async (
  request: SceneRequest | ClipRequest,
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<LoadedBoxes | ClipAnswer<unknown>> => (await loadBoxCode()).openBoxes(request, signal, onProgress);

export const readBox = async (request: BoxRequest, signal: AbortSignal): Promise<ArrayBuffer> =>
  (await loadBoxCode()).readBox(request, signal);

export const openManifest = async (
  request: FileRequest,
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<DetailManifest> => {
  const code = await loadModule('the code that streams scenes', () => import('./open-manifest.js'));
  return code.openManifest(request, signal, onProgress);
};

export const makeFloor = async (request: FloorRequest, signal: AbortSignal): Promise<FloorMap> => {
  const code = await loadModule('the code that finds the floor', () => import('../floor/make-floor.js'));
  return code.makeFloor(request, signal);
};

export const openMeshFile = async (
  request: FileRequest,
  signal: AbortSignal,
  onProgress?: ProgressListener,
): Promise<LoadedMesh> => {
  const code = await loadModule('the code that reads meshes', () => import('./open-mesh-file.js'));
  return code.openMeshFile(request, signal, onProgress);
};

export const openModel = async (request: ModelRequest, signal: AbortSignal): Promise<OpenedModel> => {
  const code = await loadModule('the code that reads models', () => import('./open-model.js'));
  return code.openModel(request, signal);
};

const transferablesOf = ({ views, images }: LoadedMesh): Transferable[] => [
  ...views.flatMap((view) => (view ? ('source' in view ? view.source : view).buffer : [])),
  ...images.flatMap((image) => image ?? []),
];

/** The members of a worker's global scope that are used here; TypeScript's DOM types lack them. */
interface WorkerScope {
  postMessage(message: WorkerMessage, transfer?: Transferable[]): void;
  addEventListener(type: 'message', listener: (event: MessageEvent<PageMessage>) => void): void;
}

/** Result of a request, and those of its buffers that are transferred. */
type Answer = readonly [answer: unknown, transfer?: Transferable[]];

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

  async function load(id: number, work: Work, message: Extract<WorkerRequest, { type: 'load' }>): Promise<Answer> {
    const scene = await loadScene(message.request, work.abort.signal, {
      onProgress: progressOf(id),
      onPreview: message.wantsPreviews
        ? (preview) => scope.postMessage({ type: 'preview', id, scene: preview }, buffersOf(preview.packed))
        : undefined,
      onPart: message.wantsParts ? (part) => sendPart(id, work, part) : undefined,
      onReading: (isReading) => scope.postMessage({ type: isReading ? 'reading' : 'rested', id }),
      askForHelp: (max, onHelper) => {
        work.onHelper = onHelper;
        scope.postMessage({ type: 'help', id, max });
      },
    });
    return [scene, 'packed' in scene && scene.packed ? buffersOf(scene.packed) : []];
  }

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

  const progressOf =
    (id: number): ProgressListener =>
    (loaded, total) =>
      scope.postMessage({ type: 'progress', id, loaded, total });

  async function buildLevels(
    { packed }: Extract<WorkerRequest, { type: 'levels' }>,
    signal: AbortSignal,
  ): Promise<Answer> {
    const { levelsInTurns } = await loadModule(
      'the code that builds levels of detail',
      () => import('./levels-in-turns.js'),
    );
    const levels = await levelsInTurns(packed, signal);
    return [levels, levels ? buffersOf(levels, levels.coarser) : []];
  }

  /**
   * Returns a buffer as an answer, which transfers it. Streamed scenes are fetched in the worker, because reading a
   * response takes a thread longer than all other work for a page.
   */
  const whole = async (bytes: Promise<ArrayBuffer>): Promise<Answer> => [await bytes, [await bytes]];

  async function answerTo(id: number, work: Work, message: WorkerRequest): Promise<Answer> {
    const { signal } = work.abort;
    if (message.type === 'load') return load(id, work, message);
    if (message.type === 'file') return whole(fetchFile(message.request, signal));
    // All requests below keep the worker from responding for some time.
    scope.postMessage({ type: 'reading', id });
    if (message.type === 'levels') return buildLevels(message, signal);
    if (message.type === 'box') return whole(readBox(message.request, signal));
    if (message.type === 'floor') {
      const map = await makeFloor(message.request, signal);
      return [map, buffersOf(map.layers)];
    }
    if (message.type === 'mesh') {
      const mesh = await openMeshFile(message.request, signal, progressOf(id));
      return [mesh, transferablesOf(mesh)];
    }
    if (message.type === 'model') {
      const model = await openModel(message.request, signal);
      return [model, model.whole ? [model.whole.buffer as ArrayBuffer] : []];
    }
    if (message.type === 'manifest') return [await openManifest(message.request, signal, progressOf(id))];
    const opened = await openBoxes(message.request, signal, progressOf(id));
    return [opened, buffersOf(opened, opened.levels)];
  }

  /**
   * Runs a request, and posts its answer or its error. Errors without a code get one. Canceled requests are not
   * answered.
   */
  async function run(id: number, message: WorkerRequest): Promise<void> {
    const work: Work = { abort: new AbortController(), taken: [] };
    const { signal } = work.abort;
    running.set(id, work);
    try {
      const asked = 'request' in message && 'file' in message.request ? message.request : undefined;
      // The fragment of the new address contains the name of the file.
      if (asked?.file) Object.assign(asked, { url: URL.createObjectURL(asked.file) + new URL(asked.url).hash });
      const [answer, transfer] = await answerTo(id, work, message);
      if (!signal.aborted) scope.postMessage({ type: 'answer', id, answer }, transfer);
    } catch (error) {
      if (!signal.aborted) scope.postMessage({ type: 'error', id, error: named(error, 'scene worker').toData() });
    } finally {
      running.delete(id);
      scope.postMessage({ type: 'rested', id });
    }
  }

  scope.addEventListener('message', ({ data }) => {
    if (data.type === 'ping') scope.postMessage({ type: 'pong' });
    else if (data.type === 'cancel') running.get(data.id)?.abort.abort();
    else if (data.type === 'taken') running.get(data.id)?.taken.shift()?.(data.buffers);
    else if (data.type === 'helper') running.get(data.id)?.onHelper?.(data.port);
    else if (data.type === 'pack') serveWith(import('./pack-rows.js'), ({ packRows }) => packRows(data.port));
    else if (data.type === 'sort')
      serveWith(import('./sort-splats.js'), ({ sortSplats }) => sortSplats(data.port, data.positions, data.areas));
    else if (data.type === 'run-on-cpu')
      serveWith(import('@gaussian-splat/generator'), ({ handleCpuRun }) => handleCpuRun(data));
    else void run(data.id, data);
  });
  scope.postMessage({ type: 'ready' });
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
