/**
 * The module worker that loads scenes. Where a page refuses workers it imports this same module and calls
 * {@link loadScene} and the others itself; then nothing here listens.
 */
import { loadModule } from '@gaussian-splat/core';
import { buffersOf } from './buffers-of.js';
import { fetchFile } from './fetch-file.js';
import { loadScene, named } from './load-scene.js';
import type * as boxes from './lod-boxes.js';
import type {
  BoxRequest,
  LoadedBoxes,
  PageMessage,
  PreviewListener,
  ProgressListener,
  SceneRequest,
  WorkerMessage,
} from './protocol.js';

export { fetchFile, loadScene };

const loadBoxCode = (): Promise<typeof boxes> =>
  loadModule('the code that streams SOG', () => import('./lod-boxes.js'));

export const openBoxes = async (
  request: SceneRequest,
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<LoadedBoxes> => (await loadBoxCode()).openBoxes(request, signal, onProgress);

export const readBox = async (request: BoxRequest, signal: AbortSignal): Promise<ArrayBuffer> =>
  (await loadBoxCode()).readBox(request, signal);

/** The part of a worker's global scope that is used here; TypeScript's page types do not know it. */
interface WorkerScope {
  postMessage(message: WorkerMessage, transfer?: Transferable[]): void;
  addEventListener(type: 'message', listener: (event: MessageEvent<PageMessage>) => void): void;
}

function serve(scope: WorkerScope): void {
  const running = new Map<number, AbortController>();

  /** Does what a message asks for, and answers: with an error, too, that nobody has named. For what was called off nobody waits. */
  async function answer(id: number, work: (signal: AbortSignal) => Promise<void>): Promise<void> {
    const abort = new AbortController();
    running.set(id, abort);
    try {
      await work(abort.signal);
    } catch (error) {
      if (!abort.signal.aborted) scope.postMessage({ type: 'error', id, error: named(error, 'scene worker').toData() });
    } finally {
      running.delete(id);
    }
  }

  const progressOf =
    (id: number): ProgressListener =>
    (loaded, total) =>
      scope.postMessage({ type: 'progress', id, loaded, total });

  const load = ({ id, request, wantsPreviews }: Extract<PageMessage, { type: 'load' }>): Promise<void> =>
    answer(id, async (signal) => {
      const onPreview: PreviewListener = (preview) =>
        scope.postMessage({ type: 'preview', id, scene: preview }, buffersOf(preview.packed));
      const scene = await loadScene(request, signal, progressOf(id), wantsPreviews ? onPreview : undefined);
      if (signal.aborted) return;
      if ('frames' in scene) scope.postMessage({ type: 'sequence', id, sequence: scene });
      else scope.postMessage({ type: 'scene', id, scene }, buffersOf(scene.packed));
    });

  /** Of a streamed scene: the reading of a response costs its thread more than all else that a page of it does. */
  const bring = (id: number, bytesOf: (signal: AbortSignal) => Promise<ArrayBuffer>): Promise<void> =>
    answer(id, async (signal) => {
      const bytes = await bytesOf(signal);
      scope.postMessage({ type: 'file', id, bytes }, [bytes]);
    });

  const open = ({ id, request }: Extract<PageMessage, { type: 'boxes' }>): Promise<void> =>
    answer(id, async (signal) => {
      const boxes = await openBoxes(request, signal, progressOf(id));
      scope.postMessage({ type: 'boxes', id, boxes }, buffersOf(boxes.levels));
    });

  const buildLevels = ({ id, packed }: Extract<PageMessage, { type: 'levels' }>): Promise<void> =>
    answer(id, async (signal) => {
      const { levelsInTurns } = await loadModule(
        'the code that builds levels of detail',
        () => import('./levels-in-turns.js'),
      );
      const levels = await levelsInTurns(packed, signal);
      scope.postMessage({ type: 'levels', id, levels }, levels ? buffersOf(levels, levels.coarser) : []);
    });

  scope.addEventListener('message', ({ data }) => {
    if (data.type === 'load') void load(data);
    else if (data.type === 'levels') void buildLevels(data);
    else if (data.type === 'file') void bring(data.id, (signal) => fetchFile(data.request, signal));
    else if (data.type === 'box') void bring(data.id, (signal) => readBox(data.request, signal));
    else if (data.type === 'boxes') void open(data);
    else running.get(data.id)?.abort();
  });
  scope.postMessage({ type: 'ready' });
}

const isWorker = typeof document === 'undefined' && 'WorkerGlobalScope' in globalThis;
if (isWorker) serve(globalThis as unknown as WorkerScope);
