import { GaussianSplatError, type Bounds } from '@gaussian-splat/core';
import {
  chooseVariants,
  GaussianBuffers,
  Renderer,
  type FrameRequest,
  type GaussianScene,
  type ProbeAnswer,
  type ProbePoint,
  type Quality,
} from '@gaussian-splat/renderer';
import type { Frame, FrameFilter } from '../live/frame-filter.js';
import type { LiveModel, LiveRequest } from '../live/live-model.js';
import type { LoadedScene, ProgressListener, SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import { assertWebGpu } from './request-device.js';
import type { DeviceLease, SharedDevice } from './shared-device.js';

/** How much detail of a streamed scene is drawn. */
export type DetailLevers = Pick<FrameRequest, 'detail' | 'splatBudget'>;

/** Gaussians with one owner. */
export interface OwnedGaussians extends GaussianScene {
  /** Splats of the file that were left out; a generator's are counted by nobody. */
  readonly droppedCount?: number;
  readonly byteLength: number;
  destroy(): void;
}

/**
 * A scene on the GPU: its splats, the renderer that draws them (whose buffers fit this scene and this picture size,
 * and so cannot be shared), and the lease that keeps the device.
 */
export class GpuScene {
  readonly bounds: Bounds;
  readonly gaussians: OwnedGaussians;
  /** The generator that writes the Gaussians; undefined for those of a file. */
  readonly live: LiveModel | undefined;
  /** Called when the frame just drawn lacked something that the next one will have. */
  onIncomplete: () => void = () => undefined;
  #renderer: Renderer;
  #quality: Quality = 'default';
  #filter: FrameFilter | undefined;
  readonly #submissions: number;
  readonly #lease: DeviceLease;
  readonly #detail: DetailLevers;
  #destroyed = false;

  constructor(
    lease: DeviceLease,
    gaussians: OwnedGaussians,
    bounds: Bounds,
    submissions: number,
    { live, detail = {} }: { live?: LiveModel; detail?: DetailLevers } = {},
  ) {
    this.#lease = lease;
    this.#detail = detail;
    this.live = live;
    this.gaussians = gaussians;
    this.bounds = bounds;
    this.#submissions = submissions;
    this.#renderer = this.#makeRenderer();
  }

  get device(): GPUDevice {
    return this.#lease.device;
  }

  get isLost(): boolean {
    return this.#lease.isLost;
  }

  /** Fulfils when the device is lost. */
  get lost(): Promise<GPUDeviceLostInfo> {
    return this.#lease.lost;
  }

  get isDestroyed(): boolean {
    return this.#destroyed;
  }

  /** Draws the frames to come at this quality. */
  setQuality(quality: Quality): void {
    if (quality === this.#quality) return;
    this.#quality = quality;
    this.#renderer.destroy();
    this.#renderer = this.#makeRenderer();
  }

  /** What stands between the renderer and the canvas; undefined for frames as they are drawn. */
  get filter(): FrameFilter | undefined {
    return this.#filter;
  }

  /** The scene closes its filter when it gets another one, and when it is destroyed. */
  setFilter(filter: FrameFilter | undefined): void {
    this.#filter?.close();
    this.#filter = filter;
  }

  #makeRenderer(): Renderer {
    const onIncomplete = (): void => {
      this.#filter?.invalidate();
      this.onIncomplete();
    };
    return new Renderer(this.device, { quality: this.#quality, submissions: this.#submissions, onIncomplete });
  }

  /** Encodes and submits one frame. */
  render(frame: Frame): void {
    const draw = (drawn: Frame): void =>
      this.#renderer.render({ ...drawn, ...this.#detail, gaussians: this.gaussians });
    if (this.#filter) this.#filter.render(frame, `${this.gaussians.version} ${this.#quality}`, draw);
    else draw(frame);
  }

  /**
   * Renders the first frame, for which the renderer allocates its buffers, and waits until the GPU has finished it.
   * @throws GaussianSplatError `out-of-memory/allocation`: WebGPU tells of a failed allocation only through a scope.
   */
  async renderFirst(frame: Frame): Promise<void> {
    const { device } = this;
    device.pushErrorScope('out-of-memory');
    let refusal: Promise<GPUError | null>;
    try {
      this.render(frame);
    } finally {
      // A lost device closes no scopes; its loss is reported elsewhere.
      refusal = device.popErrorScope().catch(() => null);
    }
    const error = await refusal;
    if (error !== null) throw outOfMemory(error);
    await device.queue.onSubmittedWorkDone().catch(() => undefined);
  }

  /** Looks into the last frame: see {@link Renderer.probeDepth}. */
  probe(points: readonly ProbePoint[]): Promise<ProbeAnswer[]> {
    return this.#renderer.probeDepth(points);
  }

  /** Frees the GPU memory and lets go of the device. */
  destroy(): void {
    if (this.#destroyed) return;
    this.#destroyed = true;
    this.setFilter(undefined);
    this.live?.close();
    this.#renderer.destroy();
    this.gaussians.destroy();
    this.#lease.release();
  }
}

export interface OpenOptions {
  readonly device: SharedDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  readonly onProgress: ProgressListener;
  /** Called when the new scene is about to be uploaded: the moment to free an old one, so that both never coexist. */
  readonly beforeUpload: () => void;
  /** Bytes of GPU memory that the scene may take; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** Submissions that the painting of a frame is divided into. */
  readonly submissions: number;
  /** What a generator needs to know beyond the request. */
  readonly live: () => Omit<LiveRequest, 'url' | 'chain' | 'contract' | 'credentials' | 'memoryBudget'>;
}

/** Device and file at the same time, then the upload. Rejects with GaussianSplatError or the signal's reason. */
export async function openGpuScene(request: SceneRequest, options: OpenOptions): Promise<GpuScene> {
  // Known at once, and then not a byte is fetched.
  assertWebGpu();
  if (isGenerator(request)) return openLiveScene(request, options);
  if (isStreamed(request)) return openStreamedScene(request, options);
  // Whichever of the two fails ends the other: without a GPU the bytes are of no use.
  const abort = new AbortController();
  const giveUp = (): void => abort.abort(options.signal.reason);
  options.signal.addEventListener('abort', giveUp, { once: true });
  const acquiring = options.device.acquire();
  // While the bytes are on their way there is time to find out what suits the device.
  const choosing = acquiring.then(({ device }) => chooseVariants(device));
  const loading = options.loader.load(request, abort.signal, options.onProgress);
  try {
    const [lease, scene] = await Promise.all([acquiring, loading, choosing.catch(unlessWrong)]);
    options.signal.throwIfAborted();
    options.beforeUpload();
    return await upload(lease, scene, options);
  } catch (error) {
    abort.abort(error);
    acquiring.then((lease) => lease.release(), ignore);
    loading.catch(ignore);
    throw error;
  } finally {
    options.signal.removeEventListener('abort', giveUp);
  }
}

/** Generators are known by the name of the file, or by the contract that the page gives along. */
function isGenerator({ url, contract }: SceneRequest): boolean {
  if (contract !== undefined && contract !== null && contract !== '') return true;
  const { pathname, protocol, hash } = URL.canParse(url) ? new URL(url) : { pathname: url, protocol: '', hash: '' };
  return /\.onnx$/i.test(protocol === 'blob:' ? hash : pathname);
}

async function openLiveScene(request: SceneRequest, options: OpenOptions): Promise<GpuScene> {
  const { signal, onProgress, beforeUpload, memoryBudget, submissions } = options;
  const opening = import('../live/open-live-model.js');
  const acquiring = options.device.acquire();
  opening.catch(ignore);
  const lease = await acquiring;
  try {
    signal.throwIfAborted();
    const { openLiveModel } = await opening;
    const { url, chain = [], contract, credentials } = request;
    const live = await openLiveModel(
      { ...options.live(), url, chain, contract, credentials, memoryBudget },
      lease.device,
      signal,
      onProgress,
    );
    beforeUpload();
    return new GpuScene(lease, live.gaussians, live.bounds, submissions, { live });
  } catch (error) {
    lease.release();
    throw error;
  }
}

/** A folder that `npm run detail` wrote is known by the name of its manifest. */
function isStreamed({ url }: SceneRequest): boolean {
  return URL.canParse(url) && /(^|\/)detail\.json$/.test(new URL(url).pathname);
}

async function openStreamedScene(request: SceneRequest, options: OpenOptions): Promise<GpuScene> {
  const { signal, onProgress, beforeUpload, memoryBudget, submissions } = options;
  const opening = import('./open-streamed.js');
  const acquiring = options.device.acquire();
  opening.catch(ignore);
  const lease = await acquiring;
  let scene: GpuScene | undefined;
  try {
    await chooseVariants(lease.device).catch(unlessWrong);
    const { openStreamed } = await opening;
    const onChange = (): void => scene?.onIncomplete();
    beforeUpload();
    const { gaussians, detail } = await openStreamed(request, lease.device, {
      ...{ signal, onProgress, memoryBudget, onChange },
    });
    scene = new GpuScene(lease, gaussians, gaussians.bounds, submissions, { detail });
    return scene;
  } catch (error) {
    lease.release();
    throw error;
  }
}

async function upload(
  lease: DeviceLease,
  { packed, bounds }: LoadedScene,
  { signal, memoryBudget, submissions }: OpenOptions,
): Promise<GpuScene> {
  const gaussians = await GaussianBuffers.upload(lease.device, packed, { memoryBudget });
  if (!signal.aborted) return new GpuScene(lease, gaussians, bounds, submissions);
  gaussians.destroy();
  throw signal.reason;
}

function outOfMemory(cause: GPUError): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/allocation', {
    where: 'first frame',
    expected: 'enough free GPU memory',
    found: cause.message || 'an allocation that failed',
    remedy: 'show a smaller scene, or close other pages and elements that use the GPU',
    cause,
  });
}

/** That no variant draws the right image ends the loading; that none could be timed does not. */
function unlessWrong(error: unknown): void {
  if (error instanceof GaussianSplatError && error.code === 'unsupported/wrong-image') throw error;
}

function ignore(): void {
  // The failure that matters has been thrown already.
}
