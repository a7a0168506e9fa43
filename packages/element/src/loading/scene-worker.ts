/**
 * The module worker that loads scenes. Where a page refuses workers it imports this same module and calls
 * {@link loadScene} itself; then nothing here listens.
 */
import { GaussianSplatError } from '@gaussian-splat/core';
import { loadScene } from './load-scene.js';
import type { LoadedScene, PageMessage, PreviewListener, ProgressListener, WorkerMessage } from './protocol.js';

export { loadScene };

/** The part of a worker's global scope that is used here; TypeScript's page types do not know it. */
interface WorkerScope {
  postMessage(message: WorkerMessage, transfer?: Transferable[]): void;
  addEventListener(type: 'message', listener: (event: MessageEvent<PageMessage>) => void): void;
}

/** Every buffer of a packed scene once: transferred, a scene of any size changes threads at no cost. */
function buffersOf(scene: LoadedScene): ArrayBuffer[] {
  const buffers = Object.values(scene.packed)
    .filter((value): value is ArrayBufferView<ArrayBuffer> => ArrayBuffer.isView(value))
    .map((view) => view.buffer);
  return [...new Set(buffers)];
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
        scope.postMessage({ type: 'preview', id, scene: preview }, buffersOf(preview));
      const scene = await loadScene(request, abort.signal, onProgress, wantsPreviews ? onPreview : undefined);
      if (abort.signal.aborted) return;
      if ('frames' in scene) scope.postMessage({ type: 'sequence', id, sequence: scene });
      else scope.postMessage({ type: 'scene', id, scene }, buffersOf(scene));
    } catch (error) {
      // loadScene throws its own errors, or the reason of an abort, which nobody waits for.
      if (error instanceof GaussianSplatError) scope.postMessage({ type: 'error', id, error: error.toData() });
      else if (!abort.signal.aborted) throw error;
    } finally {
      running.delete(id);
    }
  }

  scope.addEventListener('message', ({ data }) => {
    if (data.type === 'load') void load(data);
    else running.get(data.id)?.abort();
  });
  scope.postMessage({ type: 'ready' });
}

const isWorker = typeof document === 'undefined' && 'WorkerGlobalScope' in globalThis;
if (isWorker) serve(globalThis as unknown as WorkerScope);
