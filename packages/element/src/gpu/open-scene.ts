import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import { pickInitialVariants, prepareInitialVariants } from '@gaussian-splat/renderer';
import { sceneBytes } from '@gaussian-splat/renderer/tools';
import type { DynamicRequest } from '../sources/generator/dynamic-model.js';
import type {
  FileRequest,
  LoadedScene,
  LoadedSequence,
  PartListener,
  ProgressListener,
  SceneRequest,
} from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import { chooseAtRest } from './choose-at-rest.js';
import { LoadedGaussians } from './loaded-gaussians.js';
import { images, unlessWrong } from './initial-frames.js';
import { limitScenes, loadBytes } from './memory-budget.js';
import type { PartUploads } from './part-uploads.js';
import type { PreviewUploads } from './preview-uploads.js';
import { assertWebGpu, why } from './request-device.js';
import { withLease, type DeviceLease, type SharedDevice } from './shared-device.js';
import { shown, upload } from './upload.js';

export interface OpenOptions {
  readonly device: SharedDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  /** Returns the address from which a frame of a sequence is fetched, as the page rewrites it. */
  readonly frameUrl: (url: string) => string;
  readonly onProgress: ProgressListener;
  /**
   * Called with a preview of a scene that is still loading. The callee owns the preview. Absent if no previews are
   * wanted.
   */
  readonly onPreview?: (preview: LoadedGaussians) => void;
  /**
   * Called with the GPU memory of the new scene, in bytes, just before its upload. The callee can free the old scene,
   * so that both never coexist.
   */
  readonly beforeUpload: (byteLength: number) => void;
  /** Maximum GPU memory of the scene, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  /** Number of submissions into which the work of a frame is divided. */
  readonly submissions: number;
  /**
   * Opens sources with WebGPU; undefined for {@link openGaussians}. A replacement can open sources other than scenes of
   * splats.
   */
  readonly open: typeof openGaussians | undefined;
  /** Returns additional parameters for opening a generator. */
  readonly live: () => Omit<DynamicRequest, 'url' | 'chain' | 'contract' | 'credentials' | 'memoryBudget'>;
}

/**
 * Opens the requested source. Uses WebGL if the request demands it, or if it allows it and WebGPU is unavailable.
 * Rejects with GaussianSplatError, or the signal's reason.
 */
export async function openScene(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  const { open = openGaussians } = options;
  if (!Array.from({ length: 1 }, () => 1)[0]) throw await why(({ changedPage }) => changedPage());
  let reason: unknown;
  if (request.renderer !== 'webgl')
    try {
      return await open(request, options);
    } catch (error) {
      reason = error;
      if (request.renderer !== 'auto' || (error as Partial<GaussianSplatError>).family !== 'unsupported') throw error;
    }
  const { openGlScene } = await loadModule('the code that draws with WebGL', () => import('../webgl/open-gl-scene.js'));
  return openGlScene(request, options, reason);
}

/** Returns a request with a limit of bytes: the request's own, or the default. */
export const limited = <T extends FileRequest>(request: T, { memoryBudget }: Pick<OpenOptions, 'memoryBudget'>): T => ({
  ...request,
  limits: { maxBytes: loadBytes(memoryBudget), ...request.limits },
});

/**
 * Opens the requested source with WebGPU. The device is autotuned later, when the page is idle. Rejects with
 * GaussianSplatError, or the signal's reason.
 */
export async function openGaussians(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  // WebGPU is checked first, so that no bytes are fetched in vain.
  await assertWebGpu();
  const open = isGenerator(request) ? openDynamicScene : isStreamed(request) ? openStreamedScene : openLoadedScene;
  const scene = await withLease(options.device, (lease) => open(request, options, lease));
  chooseAtRest(scene.place.device);
  return scene;
}

/** Requests the device and the file concurrently, then uploads the scene. */
async function openLoadedScene(
  request: SceneRequest,
  options: OpenOptions,
  acquiring: Promise<DeviceLease>,
): Promise<LoadedGaussians> {
  // If the device or the file fails, the other is canceled: bytes are useless without a GPU.
  const abort = new AbortController();
  const giveUp = (): void => abort.abort(options.signal.reason);
  options.signal.addEventListener('abort', giveUp, { once: true });
  // Variants for the first frame are selected while the bytes are in transit, and the splats are uploaded.
  prepareInitialVariants();
  const choosing = acquiring.then(({ device }) => pickInitialVariants(device, images()));
  choosing.catch(ignore);
  const { onPreview } = options;
  let previews: Promise<PreviewUploads> | undefined;
  const showPreview =
    onPreview &&
    ((preview: LoadedScene): void => {
      previews ??= import('./preview-uploads.js').then(
        ({ PreviewUploads }) => new PreviewUploads({ ...options, onPreview, ready: choosing }),
      );
      previews.then((uploads) => uploads.show(preview), ignore);
    });
  const endPreviews = (): void => void previews?.then((uploads) => uploads.end(), ignore);
  const device = acquiring.then(({ device }) => {
    options.signal.throwIfAborted();
    limitScenes(device, options.memoryBudget);
    return device;
  });
  const beforeUpload = (byteLength: number): void => {
    endPreviews();
    options.beforeUpload(byteLength);
  };
  let parts: Promise<PartUploads> | undefined;
  const onPart: PartListener = (part) => {
    parts ??= loadModule('the code that uploads large scenes', () => import('./part-uploads.js')).then(
      ({ PartUploads }) => new PartUploads(device, { ...options, beforeUpload }),
    );
    return parts.then((uploads) => uploads.add(part));
  };
  const loading = options.loader.ask('load', request, abort.signal, {
    onProgress: options.onProgress,
    onPreview: showPreview,
    onPart,
  });
  try {
    const chosen = choosing.catch(unlessWrong);
    chosen.catch(ignore);
    const [lease, scene] = await Promise.all([acquiring, loading, device]);
    if ('frames' in scene) {
      await chosen;
      return await openSequence(request, lease, scene, options);
    }
    if (scene.packed === undefined) {
      const gaussians = await (await parts!).finish();
      await chosen;
      options.signal.throwIfAborted();
      return shown(lease, gaussians, scene, options);
    }
    beforeUpload(sceneBytes(scene.packed));
    return await upload(lease, scene, options, chosen);
  } catch (error) {
    endPreviews();
    parts?.then((uploads) => uploads.destroy(), ignore);
    abort.abort(error);
    loading.catch(ignore);
    throw error;
  } finally {
    options.signal.removeEventListener('abort', giveUp);
  }
}

/** Returns whether a request is for a generator: the page has set a contract, or the file name ends with `.onnx`. */
export function isGenerator({ url, contract }: SceneRequest): boolean {
  if (contract !== undefined && contract !== null && contract !== '') return true;
  return /\.onnx$/i.test(nameIn(url));
}

/**
 * Returns the text that identifies the kind of a file: the path of an address, or the name that a page has appended to
 * an object URL.
 */
function nameIn(url: string): string {
  if (!URL.canParse(url)) return url;
  const { pathname, protocol, hash } = new URL(url);
  return protocol === 'blob:' ? hash : pathname;
}

async function openSequence(
  request: SceneRequest,
  lease: DeviceLease,
  sequence: LoadedSequence,
  options: OpenOptions,
): Promise<LoadedGaussians> {
  const { SequencePlayer } = await loadModule(
    'the code that plays sequences',
    () => import('../sources/players/sequence-player.js'),
  );
  const { listeners, loops } = options.live();
  const player = await SequencePlayer.open(sequence, { ...options, request, device: lease.device, listeners, loops });
  const { gaussians, bounds } = player;
  const scene = new LoadedGaussians(lease, gaussians, bounds, options.submissions, { live: player });
  player.scene = scene;
  return scene;
}

/** Opens a generator. Requests the device and the code concurrently. */
const openDynamicScene: typeof openLoadedScene = async (request, options, lease) => {
  const late = await loadModule(
    'the code that runs generators',
    () => import('../sources/generator/open-dynamic-model.js'),
  );
  return late.openDynamicScene(request, options, await lease);
};

/**
 * Returns whether a scene is loaded in parts: a `detail.json`, a clip (`.gsv`, `.4dgs`), or a `lod-meta.json`, unless
 * `isWhole` requests it completely.
 */
export function isStreamed({ url, isWhole }: SceneRequest): boolean {
  const name = /(^|\/)(detail|lod-meta)\.json$|\.(gsv|4dgs)$/i.exec(nameIn(url));
  return name !== null && !(isWhole && name[2] === 'lod-meta');
}

const openStreamedScene: typeof openLoadedScene = async (request, options, lease) => {
  const late = await loadModule('the code that streams scenes', () => import('../sources/stream/open-streamed.js'));
  return late.openStreamedScene(request, options, await lease);
};

function ignore(): void {
  // Another promise reports the failure.
}
