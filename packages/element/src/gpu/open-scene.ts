import { GaussianSplatError, loadModule } from '@gaussian-splat/core';
import { startVariants } from '@gaussian-splat/renderer';
import { sceneBytes } from '@gaussian-splat/renderer/tools';
import type { LiveRequest } from '../live/live-model.js';
import type { FileRequest, LoadedSequence, PartListener, ProgressListener, SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import { chooseAtRest } from './choose-at-rest.js';
import { LoadedGaussians } from './loaded-gaussians.js';
import { limitScenes, loadBytes } from './memory-budget.js';
import type { PartUploads } from './part-uploads.js';
import { PreviewUploads } from './preview-uploads.js';
import { assertWebGpu, why } from './request-device.js';
import type { DeviceLease, SharedDevice } from './shared-device.js';
import { shown, upload } from './upload.js';
import { canvasFormat } from './viewport.js';

export interface OpenOptions {
  readonly device: SharedDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  /** Address of a frame of a sequence as it is fetched. */
  readonly frameUrl: (url: string) => string;
  readonly onProgress: ProgressListener;
  /** Called with what can be shown of a scene that is still loading; the scene is the callee's. Absent: previews are not wanted. */
  readonly onPreview?: (preview: LoadedGaussians) => void;
  /** Called when the new scene is about to be uploaded: the moment to free an old one, so that both never coexist. Gets its bytes. */
  readonly beforeUpload: (byteLength: number) => void;
  /** Bytes of GPU memory that the scene may take; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** Submissions that the painting of a frame is divided into. */
  readonly submissions: number;
  /** Opens what is no scene of splats. */
  readonly open: typeof openGaussians | undefined;
  /** What a generator needs to know beyond the request. */
  readonly live: () => Omit<LiveRequest, 'url' | 'chain' | 'contract' | 'credentials' | 'memoryBudget'>;
}

/** Opens what is asked for, with WebGL where there is no WebGPU and the request lets it. Rejects with GaussianSplatError or the signal's reason. */
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

/** The request with the bytes that a load may take by default. */
export const limited = <T extends FileRequest>(request: T, { memoryBudget }: Pick<OpenOptions, 'memoryBudget'>): T => ({
  ...request,
  limits: { maxBytes: loadBytes(memoryBudget), ...request.limits },
});

/** Opens what is asked for with WebGPU; what its device is served best with is looked for later. Rejects with GaussianSplatError or the signal's reason. */
export async function openGaussians(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  // Known at once, and then not a byte is fetched.
  await assertWebGpu();
  const open = isGenerator(request) ? openLiveScene : isStreamed(request) ? openStreamedScene : openLoadedScene;
  const scene = await open(limited(request, options), options);
  chooseAtRest(scene.device);
  return scene;
}

/** Device and file at the same time, then the upload. */
async function openLoadedScene(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  // Whichever of the two fails ends the other: without a GPU the bytes are of no use.
  const abort = new AbortController();
  const giveUp = (): void => abort.abort(options.signal.reason);
  options.signal.addEventListener('abort', giveUp, { once: true });
  const acquiring = options.device.acquire();
  // While the bytes are on their way there is time to find out what a first picture can be drawn with.
  const choosing = acquiring.then(({ device }) => startVariants(device, pictures()));
  const previews =
    options.onPreview && new PreviewUploads({ ...options, onPreview: options.onPreview, ready: choosing });
  const device = acquiring.then(async ({ device }) => {
    await choosing.catch(unlessWrong);
    options.signal.throwIfAborted();
    limitScenes(device, options.memoryBudget);
    return device;
  });
  const beforeUpload = (byteLength: number): void => {
    previews?.end();
    options.beforeUpload(byteLength);
  };
  let parts: Promise<PartUploads> | undefined;
  const onPart: PartListener = (part) => {
    parts ??= loadModule('the code that uploads large scenes', () => import('./part-uploads.js')).then(
      ({ PartUploads }) => new PartUploads(device, { ...options, beforeUpload }),
    );
    parts.then((uploads) => uploads.add(part), ignore);
  };
  const loading = options.loader.open(request, abort.signal, options.onProgress, previews?.show, onPart);
  try {
    const [lease, scene] = await Promise.all([acquiring, loading, device]);
    if ('frames' in scene) return await openSequence(request, lease, scene, options);
    if (scene.packed === undefined) return shown(lease, await (await parts!).finish(), scene, options);
    beforeUpload(sceneBytes(scene.packed));
    return await upload(lease, scene, options);
  } catch (error) {
    previews?.end();
    parts?.then((uploads) => uploads.destroy(), ignore);
    abort.abort(error);
    acquiring.then((lease) => lease.release(), ignore);
    loading.catch(ignore);
    throw error;
  } finally {
    options.signal.removeEventListener('abort', giveUp);
  }
}

/** Generators are known by the name of the file, or by the contract that the page gives along. */
export function isGenerator({ url, contract }: SceneRequest): boolean {
  if (contract !== undefined && contract !== null && contract !== '') return true;
  return /\.onnx$/i.test(nameIn(url));
}

/** What tells a kind: the path of an address, or the name that a page gives a file behind it. */
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
    () => import('../live/sequence-player.js'),
  );
  const { listeners, loops } = options.live();
  const player = await SequencePlayer.open(sequence, { ...options, request, device: lease.device, listeners, loops });
  const { gaussians, bounds } = player;
  const scene = new LoadedGaussians(lease, gaussians, bounds, options.submissions, { live: player });
  player.scene = scene;
  return scene;
}

/** Device and code at the same time. */
async function openLiveScene(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  const acquiring = options.device.acquire();
  try {
    const live = await loadModule('the code that runs generators', () => import('../live/open-live-model.js'));
    return await live.openLiveScene(request, options, await acquiring);
  } catch (error) {
    acquiring.then((lease) => lease.release(), ignore);
    throw error;
  }
}

/**
 * A folder that `gaussian-splat detail` wrote is known by the name of its manifest, a clip by its extension, and so is streamed SOG, which may be wanted whole.
 */
export function isStreamed({ url, isWhole }: SceneRequest): boolean {
  const name = /(^|\/)(detail|lod-meta)\.json$|\.gsv$/i.exec(nameIn(url));
  return name !== null && !(isWhole && name[2] === 'lod-meta');
}

async function openStreamedScene(request: SceneRequest, options: OpenOptions): Promise<LoadedGaussians> {
  const { loader, signal, onProgress, beforeUpload, memoryBudget, submissions } = options;
  const opening = loadModule('the code that streams scenes', () => import('./open-streamed.js'));
  const acquiring = options.device.acquire();
  opening.catch(ignore);
  const lease = await acquiring;
  let scene: LoadedGaussians | undefined;
  try {
    await startVariants(lease.device, pictures()).catch(unlessWrong);
    limitScenes(lease.device, memoryBudget);
    const { openStreamed } = await opening;
    signal.throwIfAborted();
    const onChange = (): void => scene?.onChange();
    // How much of it fits is decided when its manifest is there.
    beforeUpload(memoryBudget ?? 0);
    const { gaussians, bounds, ...rest } = await openStreamed(request, lease.device, {
      ...{ loader, signal, onProgress, memoryBudget, onChange, live: options.live },
    });
    scene = new LoadedGaussians(lease, gaussians, bounds, submissions, rest);
    return scene;
  } catch (error) {
    lease.release();
    throw error;
  }
}

/** What the canvas is made of. */
export const pictures = (): { format: GPUTextureFormat } => ({ format: canvasFormat() });

/** That no variant draws the right image ends the loading; that none could be timed does not. */
export function unlessWrong(error: unknown): void {
  if (error instanceof GaussianSplatError && error.code === 'unsupported/wrong-image') throw error;
}

function ignore(): void {
  // The failure that matters has been thrown already.
}
