/** Loaded when an element has meshes: three.js is behind this module. */
import type { GaussianScene } from '@gaussian-splat/renderer';
import { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { OpenOptions } from '../gpu/open-scene.js';
import { assertWebGpu } from '../gpu/request-device.js';
import type { Timeline } from '../live/live-model.js';
import type { SceneRequest } from '../loading/protocol.js';
import { Model } from './model.js';

type Options = Pick<OpenOptions, 'loader' | 'signal' | 'frameUrl'>;

/** Fetches and reads a glTF. Rejects with GaussianSplatError, or the signal's reason. */
export async function openModel(
  { url, credentials, limits }: Pick<SceneRequest, 'url' | 'credentials' | 'limits'>,
  { loader, signal, frameUrl }: Options,
): Promise<Model> {
  const bytes = await loader.fetchFile({ url, credentials, limits }, signal);
  signal.throwIfAborted();
  const model = await Model.read(bytes, { url, credentials, partUrl: frameUrl });
  if (!signal.aborted) return model;
  model.dispose();
  throw signal.reason;
}

/** Opens a mesh as a source that has no splats, so that its life is that of all sources. */
export async function openMesh(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  await assertWebGpu();
  const { device, signal, onProgress, live: liveRequest, submissions } = options;
  const acquiring = device.acquire();
  acquiring.catch(() => undefined);
  const model = await openModel(request, options).catch((error: unknown) => {
    void acquiring.then((lease) => lease.release());
    throw error;
  });
  const lease = await acquiring.catch((error: unknown) => {
    model.dispose();
    throw error;
  });
  if (signal.aborted) {
    lease.release();
    model.dispose();
    throw signal.reason;
  }
  onProgress(1, 1);
  const { onShown } = liveRequest().listeners;
  const live: Timeline | undefined = Number.isNaN(model.duration) ? undefined : timelineOf(model, onShown);
  const bounds = { ...model.bounds, up: [0, 1, 0] as const };
  const loaded = new LoadedGaussians(lease, noSplats(), bounds, submissions, { live });
  loaded.model = model;
  return loaded;
}

/** The animations of a model as what moves a scene. */
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
  pages: [],
  version: 0,
  byteLength: 0,
  destroy: () => undefined,
});
