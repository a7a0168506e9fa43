import { loadModule, type GaussianSplatError } from '@gaussian-splat/core';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import { sceneBytes } from '@gaussian-splat/renderer/tools';
import type { DynamicRequest } from '../dynamic/dynamic-model.js';
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
import type { DeviceLease, SharedDevice } from './shared-device.js';
import { shown, upload } from './upload.js';

export interface OpenOptions {
  readonly device: SharedDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  /** Address for fetching a frame of a sequence. */
  readonly frameUrl: (url: string) => string;
  readonly onProgress: ProgressListener;
  /** Called with a preview of a scene that is still loading; the callee owns it. Absent: no previews. */
  readonly onPreview?: (preview: LoadedGaussians) => void;
  /**
   * Called with the size of the new scene just before its upload: the moment to free an old one, so that both never
   * coexist.
   */
  readonly beforeUpload: (byteLength: number) => void;
  /** Upper limit of the scene's GPU memory in bytes; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** Number of submissions of a frame. */
  readonly submissions: number;
  /** Opens sources other than scenes of splats. */
  readonly open: typeof openGaussians | undefined;
  /** Additional data of a request for a generator. */
  readonly live: () => Omit<DynamicRequest, 'url' | 'chain' | 'contract' | 'credentials' | 'memoryBudget'>;
}

/**
 * Opens the requested source, with WebGL if WebGPU is unavailable and the request allows it. Rejects with
 * GaussianSplatError or the signal's reason.
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
  return openGlScene(limited(request, options), options, reason);
}

/** The request with default byte limits of a load. */
export const limited = <T extends FileRequest>(request: T, { memoryBudget }: Pick<OpenOptions, 'memoryBudget'>): T => ({
  ...request,
  limits: { maxBytes: loadBytes(memoryBudget), ...request.limits },
});

/**
 * Opens the requested source with WebGPU; autotuning of the device follows later. Rejects with GaussianSplatError or
 * the signal's reason.
 */
export async function openGaussians(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  // Checked first, so that no bytes are fetched in vain.
  await assertWebGpu();
  const open = isGenerator(request) ? openDynamicScene : isStreamed(request) ? openStreamedScene : openLoadedScene;
  const scene = await open(limited(request, options), options);
  chooseAtRest(scene.device);
  return scene;
}

/** Requests device and file concurrently, then uploads. */
async function openLoadedScene(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  // If either fails the other is canceled, because bytes are useless without a GPU.
  const abort = new AbortController();
  const giveUp = (): void => abort.abort(options.signal.reason);
  options.signal.addEventListener('abort', giveUp, { once: true });
  const acquiring = options.device.acquire();
  // While the bytes are in transit, variants for the first frame are selected.
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
  const device = acquiring.then(async ({ device }) => {
    await choosing.catch(unlessWrong);
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
    parts.then((uploads) => uploads.add(part), ignore);
  };
  const loading = options.loader.open(request, abort.signal, options.onProgress, showPreview, onPart);
  try {
    const [lease, scene] = await Promise.all([acquiring, loading, device]);
    if ('frames' in scene) return await openSequence(request, lease, scene, options);
    if (scene.packed === undefined) return shown(lease, await (await parts!).finish(), scene, options);
    beforeUpload(sceneBytes(scene.packed));
    return await upload(lease, scene, options);
  } catch (error) {
    endPreviews();
    parts?.then((uploads) => uploads.destroy(), ignore);
    abort.abort(error);
    acquiring.then((lease) => lease.release(), ignore);
    loading.catch(ignore);
    throw error;
  } finally {
    options.signal.removeEventListener('abort', giveUp);
  }
}

/** Generators are recognized by the file name, or by a contract from the page. */
export function isGenerator({ url, contract }: SceneRequest): boolean {
  if (contract !== undefined && contract !== null && contract !== '') return true;
  return /\.onnx$/i.test(nameIn(url));
}

/** The name that identifies a kind: the path of an address, or the name that a page appends to an object URL. */
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
    () => import('../dynamic/sequence-player.js'),
  );
  const { listeners, loops } = options.live();
  const player = await SequencePlayer.open(sequence, { ...options, request, device: lease.device, listeners, loops });
  const { gaussians, bounds } = player;
  const scene = new LoadedGaussians(lease, gaussians, bounds, options.submissions, { live: player });
  player.scene = scene;
  return scene;
}

/** Requests device and code concurrently. */
const openDynamicScene = (request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> =>
  openLate(options, async (lease) => {
    const late = await loadModule('the code that runs generators', () => import('../dynamic/open-dynamic-model.js'));
    return late.openDynamicScene(request, options, await lease);
  });

/**
 * LOD folders are recognized by the name of their manifest, clips by their extension, and streamed SOG by its name,
 * unless it is to be loaded completely.
 */
export function isStreamed({ url, isWhole }: SceneRequest): boolean {
  const name = /(^|\/)(detail|lod-meta)\.json$|\.(gsv|4dgs)$/i.exec(nameIn(url));
  return name !== null && !(isWhole && name[2] === 'lod-meta');
}

const openStreamedScene = (request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> =>
  openLate(options, async (lease) => {
    const late = await loadModule('the code that streams scenes', () => import('./open-streamed.js'));
    return late.openStreamedScene(request, options, await lease);
  });

/** Opens a scene with a lease, which is released if that fails. */
async function openLate(
  { device }: OpenOptions,
  open: (lease: Promise<DeviceLease>) => Promise<LoadedGaussians>,
): Promise<LoadedGaussians> {
  const acquiring = device.acquire();
  try {
    return await open(acquiring);
  } catch (error) {
    acquiring.then((lease) => lease.release(), ignore);
    throw error;
  }
}

function ignore(): void {
  // The relevant failure has already been thrown.
}
