/** The tasks of the scene worker. A task is one row of {@link WORKER_TASKS}, and a module that its row imports. */
import { loadModule } from '@gaussian-splat/core';
import { fetchScene } from '@gaussian-splat/formats';
import { throttled } from './load-helpers.js';
import { loadScene } from './load-scene.js';
import { buffersOf, type FileRequest, type TaskListeners } from './protocol.js';

/** A row of {@link WORKER_TASKS}. */
export interface WorkerTask<Asked, Answer> {
  /**
   * Imports the code of the task, which throws GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the
   * reason of the signal if that is aborted.
   */
  load(): Promise<(request: Asked, signal: AbortSignal, listeners: TaskListeners) => Promise<Answer>>;
  /** Returns the objects of an answer that are transferred to the page; default: none. */
  transfer?(answer: Answer): Transferable[];
  /** Whether the worker responds while it runs the task, or the task calls `onReading` before it does not. */
  readonly isResponsive?: boolean;
  /** Whether the task runs in workers only, because it would block a page for seconds. */
  readonly isOnlyInWorker?: boolean;
}

const task = <Asked, Answer>(row: WorkerTask<Asked, Answer>): WorkerTask<Asked, Answer> => row;

const streams = 'the code that streams scenes';
const boxes = 'the code that streams SOG';
const clips = 'the code that reads clips';

export const WORKER_TASKS = {
  load: task({
    load: async () => loadScene,
    transfer: (scene) => ('packed' in scene && scene.packed ? buffersOf(scene.packed) : []),
    isResponsive: true,
  }),
  // Files of streamed scenes are fetched in the worker, because reading a response takes a thread longer than all other
  // work for a page.
  file: task({ load: async () => fetchFile, transfer: (bytes) => [bytes], isResponsive: true }),
  levels: task({
    load: async () =>
      (await loadModule('the code that builds levels of detail', () => import('./levels-in-turns.js'))).levelsInTurns,
    transfer: (levels) => (levels ? buffersOf(levels, levels.coarser) : []),
    isOnlyInWorker: true,
  }),
  manifest: task({ load: async () => (await loadModule(streams, () => import('./open-manifest.js'))).openManifest }),
  boxes: task({
    load: async () => (await loadModule(boxes, () => import('./lod-boxes.js'))).openBoxes,
    transfer: (opened) => buffersOf(opened, opened.levels),
  }),
  box: task({
    load: async () => (await loadModule(boxes, () => import('./lod-boxes.js'))).readBox,
    transfer: (words) => [words],
  }),
  tree: task({
    load: async () => (await loadModule(streams, () => import('./scene-tree.js'))).openTree,
    transfer: (opened) => (opened ? [opened.first.words.buffer] : []),
  }),
  node: task({
    load: async () => (await loadModule(streams, () => import('./scene-tree.js'))).readNode,
    transfer: ({ words }) => [words.buffer],
  }),
  clip: task({
    load: async () => (await loadModule(clips, () => import('./clip-of.js'))).openClip,
    transfer: ({ index }) => buffersOf(index),
  }),
  'clip-part': task({
    load: async () => (await loadModule(clips, () => import('./clip-of.js'))).readPart,
    transfer: (packed) => buffersOf(packed),
  }),
  mesh: task({
    load: async () =>
      (await loadModule('the code that reads meshes', () => import('./open-mesh-file.js'))).openMeshFile,
    transfer: ({ views, images }) => [
      ...views.flatMap((view) => view?.buffer ?? []),
      ...images.flatMap((image) => image ?? []),
    ],
  }),
  model: task({
    load: async () => (await loadModule('the code that reads models', () => import('./open-model.js'))).openModel,
    transfer: ({ whole }) => (whole ? [whole.buffer as ArrayBuffer] : []),
  }),
  splats: task({
    load: async () => (await loadModule('the code that packs arrays', () => import('./pack-splats.js'))).packSplats,
    transfer: ({ packed, rows }) => buffersOf(packed, { rows }),
  }),
  floor: task({
    load: async () =>
      (await loadModule('the code that finds the floor', () => import('../floor/make-floor.js'))).makeFloor,
    transfer: ({ layers }) => buffersOf(layers),
  }),
};

type Tasks = typeof WORKER_TASKS;
export type TaskType = keyof Tasks;
type TypesOf<T extends TaskType> = Tasks[T] extends WorkerTask<infer Asked, infer Answer> ? [Asked, Answer] : never;
export type RequestOf<T extends TaskType> = TypesOf<T>[0];
export type AnswerOf<T extends TaskType> = TypesOf<T>[1];

/** Runs a task on this thread. Throws as the code of the task does: see {@link WorkerTask.load}. */
export async function runTask<T extends TaskType>(
  type: T,
  request: RequestOf<T>,
  signal: AbortSignal,
  listeners: TaskListeners,
): Promise<AnswerOf<T>> {
  const run = await (WORKER_TASKS[type] as unknown as WorkerTask<RequestOf<T>, AnswerOf<T>>).load();
  return run(request, signal, listeners);
}

/** Runs a task as {@link runTask} does, on a page without workers. Returns undefined for tasks that run only in workers. */
export const runOnPage: typeof runTask = async (type, ...rest) =>
  WORKER_TASKS[type].isOnlyInWorker ? (undefined as never) : runTask(type, ...rest);

/** Fetches a file. Returns its bytes in a buffer of their own, or the decoded words of a coded file of pages. */
async function fetchFile(
  { url, credentials, limits, coded }: FileRequest,
  signal: AbortSignal,
  listeners: TaskListeners,
): Promise<ArrayBuffer> {
  const { maxBytes, maxSeconds } = limits ?? {};
  const onProgress = throttled(listeners.onProgress);
  const bytes = await fetchScene(url, { mode: 'cors', credentials, signal, onProgress, maxBytes, maxSeconds });
  if (coded === undefined) return bytes.slice().buffer;
  // This code has been loaded before, to read the manifest.
  const { decodePage } = await loadModule(streams, () => import('./open-manifest.js'));
  return decodePage(url, bytes as Uint8Array<ArrayBuffer>, coded);
}
