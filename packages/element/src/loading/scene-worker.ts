/**
 * The module worker that loads scenes. Where a page refuses workers it imports this same module and calls
 * {@link loadScene} or {@link fetchFile} itself; then nothing here listens.
 */
import { GaussianSplatError } from '@gaussian-splat/core';
import { buffersOf } from './buffers-of.js';
import { fetchFile } from './fetch-file.js';
import { loadScene } from './load-scene.js';
import type { PageMessage, PreviewListener, ProgressListener, WorkerMessage } from './protocol.js';

export { fetchFile, loadScene };

/** The part of a worker's global scope that is used here; TypeScript's page types do not know it. */
interface WorkerScope {
  postMessage(message: WorkerMessage, transfer?: Transferable[]): void;
  addEventListener(type: 'message', listener: (event: MessageEvent<PageMessage>) => void): void;
}

function serve(scope: WorkerScope): void {
  const running = new Map<number, AbortController>();

  async function load({ id, request, wantsPreviews }: Extract<PageMessage, { type: 'load' }>): Promise<void> {
    const abort = new AbortController();
    running.set(id, abort);
    try {
      const onProgress: ProgressListener = (loaded, total) =>
        scope.postMessage({ type: 'progress', id, loaded, total });
      const onPreview: PreviewListener = (preview) =>
        scope.postMessage({ type: 'preview', id, scene: preview }, buffersOf(preview.packed));
      const scene = await loadScene(request, abort.signal, onProgress, wantsPreviews ? onPreview : undefined);
      if (abort.signal.aborted) return;
      if ('frames' in scene) scope.postMessage({ type: 'sequence', id, sequence: scene });
      else scope.postMessage({ type: 'scene', id, scene }, buffersOf(scene.packed));
    } catch (error) {
      // loadScene throws its own errors, or the reason of an abort, which nobody waits for.
      if (error instanceof GaussianSplatError) scope.postMessage({ type: 'error', id, error: error.toData() });
      else if (!abort.signal.aborted) throw error;
    } finally {
      running.delete(id);
    }
  }

  /** Of a streamed scene: the reading of a response costs its thread more than all else that a page of it does. */
  async function bring({ id, request }: Extract<PageMessage, { type: 'file' }>): Promise<void> {
    const abort = new AbortController();
    running.set(id, abort);
    try {
      const bytes = await fetchFile(request, abort.signal);
      scope.postMessage({ type: 'file', id, bytes }, [bytes]);
    } catch (error) {
      if (error instanceof GaussianSplatError) scope.postMessage({ type: 'error', id, error: error.toData() });
      else if (!abort.signal.aborted) throw error;
    } finally {
      running.delete(id);
    }
  }

  async function buildLevels({ id, packed }: Extract<PageMessage, { type: 'levels' }>): Promise<void> {
    const abort = new AbortController();
    running.set(id, abort);
    try {
      const { levelsInTurns } = await import('./levels-in-turns.js');
      const levels = await levelsInTurns(packed, abort.signal);
      scope.postMessage({ type: 'levels', id, levels }, levels ? buffersOf(levels, levels.coarser) : []);
    } catch (error) {
      if (!abort.signal.aborted) scope.postMessage({ type: 'error', id, error: outOfMemory(error).toData() });
    } finally {
      running.delete(id);
    }
  }

  scope.addEventListener('message', ({ data }) => {
    if (data.type === 'load') void load(data);
    else if (data.type === 'levels') void buildLevels(data);
    else if (data.type === 'file') void bring(data);
    else running.get(data.id)?.abort();
  });
  scope.postMessage({ type: 'ready' });
}

/** Nothing but memory can be missing for levels of a scene that is on show. */
function outOfMemory(cause: unknown): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/allocation', {
    where: 'levels of detail',
    expected: 'memory enough to build them',
    found: cause instanceof Error ? cause.message : String(cause),
    remedy: 'use a smaller scene, or write it with npm run detail',
    cause,
  });
}

const isWorker = typeof document === 'undefined' && 'WorkerGlobalScope' in globalThis;
if (isWorker) serve(globalThis as unknown as WorkerScope);
