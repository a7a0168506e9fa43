/** Opens mesh files. Loaded on demand, because of three.js, which this module imports. */
import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import { MemoryLedger, type GaussianScene } from '@gaussian-splat/renderer';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import type { Timeline } from '../generator/dynamic-model.js';
import type { LoadedMesh } from '../../loading/open-mesh-file.js';
import type { FileRequest, ProgressListener } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import type { OpenSource } from '../source-kind.js';
import { Model } from './model.js';

/**
 * Fetches and validates a glTF file and the files that it refers to. Rejects with GaussianSplatError, or the signal's
 * reason.
 */
export function fetchMesh(
  loader: SceneLoader,
  { url, credentials, limits, source }: FileRequest,
  signal: AbortSignal,
  onProgress: ProgressListener = () => undefined,
): Promise<LoadedMesh> {
  const request = { url, credentials, limits, source };
  return loader.ask('mesh', request, signal, { onProgress }).catch(async (error: unknown) => {
    // The worker that bundlers build as a single file for strict pages contains no decoders.
    if (!isMissingDecoder(error)) throw error;
    const { runOnPage } = await loadModule('the code that reads meshes', () => import('../../loading/scene-worker.js'));
    return runOnPage('mesh', request, signal, { onProgress });
  });
}

const isMissingDecoder = (error: unknown): boolean =>
  error instanceof GaussianSplatError && error.code === 'network/unreachable' && /^the decoder/.test(error.where);

/**
 * Reserves the GPU memory of a mesh, then creates its objects. `memoryBudget` is the limit in bytes; if it is
 * undefined, only the device limits the memory. Rejects with GaussianSplatError, or the signal's reason.
 */
export async function openModel(
  mesh: LoadedMesh,
  url: string,
  { device, signal, memoryBudget }: { device: GPUDevice; signal: AbortSignal; memoryBudget: number | undefined },
): Promise<Model> {
  const { byteLength } = mesh;
  try {
    signal.throwIfAborted();
    limitScenes(device, memoryBudget);
    const reservation = MemoryLedger.of(device).reserve(`mesh ${url.slice(0, 200)}`, byteLength, memoryBudget);
    const model = await Model.read(mesh, url, reservation);
    if (!signal.aborted) return model;
    model.dispose();
    throw signal.reason;
  } catch (error) {
    for (const image of mesh.images) image?.close();
    throw error;
  }
}

/** Opens a mesh file as a source without splats, which has the same lifecycle as every source. */
export const open: OpenSource = async (request, options, acquiring) => {
  const { signal, onProgress, live: dynamicRequest, submissions, beforeUpload, loader } = options;
  const mesh = await fetchMesh(loader, request, signal, onProgress);
  const lease = await acquiring;
  beforeUpload(mesh.byteLength);
  const model = await openModel(mesh, request.url, { ...options, device: lease.device });
  const { onShown } = dynamicRequest().listeners;
  const live: Timeline | undefined = Number.isNaN(model.duration) ? undefined : timelineOf(model, onShown);
  const bounds = { ...model.bounds, up: [0, 1, 0] as const };
  const { warnings, credits } = mesh;
  const loaded = new LoadedGaussians(lease, noSplats(), bounds, submissions, { live, warnings, credits });
  loaded.model = model;
  return loaded;
};

/**
 * Returns the animations of a model as the timeline of a scene.
 * @param onShown Called with each time, in seconds, that is shown.
 */
function timelineOf(model: Model, onShown: (seconds: number) => void): Timeline {
  let shown = 0;
  return {
    duration: model.duration,
    request: ({ timeSeconds }) => {
      if (timeSeconds !== shown) model.setTime(timeSeconds);
      shown = timeSeconds;
      queueMicrotask(() => onShown(timeSeconds));
    },
    close: () => undefined,
  };
}

const noSplats = (): GaussianScene & { byteLength: number; destroy(): void } => ({
  count: 0,
  shDegree: 0,
  shPrecision: 'float16',
  antialiased: false,
  origin: [0, 0, 0],
  blocks: [],
  version: 0,
  byteLength: 0,
  destroy: () => undefined,
});
