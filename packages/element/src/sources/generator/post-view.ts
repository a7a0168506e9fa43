/** Runs post-processors. The module is loaded only for them: see open-dynamic-model.ts. */
import { PostProcessor, setRuntimeLocation, type GpuTensor } from '@gaussian-splat/generator';
import { FilteredFrame } from '@gaussian-splat/renderer';
import type { Frame, FrameFilter } from './frame-filter.js';
import { inputsOf, type GeneratorInput } from './inputs.js';
import type { DynamicRequest, Timeline } from './dynamic-model.js';
import { InputImages } from './input-images.js';
import { gpuCheckOf, offerPanel } from './of-element.js';
import { readsHeaders } from './model-files.js';
import { StateReader } from './read-state.js';

export interface PostRequest extends Pick<
  DynamicRequest,
  'credentials' | 'element' | 'runtimeLocation' | 'loader' | 'limits' | 'state'
> {
  /** Absolute addresses of post-processors, in execution order. */
  readonly urls: readonly string[];
  readonly signal: AbortSignal;
  /** Returns the changing scenes that are drawn. */
  readonly shown: () => readonly Timeline[];
  /** Called when the next frame would differ, so that it must be drawn. */
  readonly onChange: () => void;
  readonly onError: (error: unknown) => void;
  readonly onFallback: (reason: string) => void;
}

/**
 * A post-processor becomes fast enough if a run takes at most the first time, ms, and remains so until a run exceeds
 * the second. A run lasts until the GPU has finished it.
 */
const IN_TIME_MS = 34;
const TOO_LATE_MS = 50;
/** Delay of the next run after a failure, ms. */
const RETRY_MS = 1_000;

/** The last frame of one size and its result. */
class Shown {
  surface: FilteredFrame | undefined;
  /** Inputs of the post-processor: the frame, and its depth if a model uses it. */
  tensor: GpuTensor | undefined;
  depth: GpuTensor | undefined;
  /** Keys of the last drawn frame, of the last input of the post-processor, and of its last output; empty for none. */
  drawn = '';
  handed = '';
  filtered = '';
}

/**
 * Shows frames that a post-processor has processed. A frame at rest is always shown processed, as soon as the result is
 * ready. While frames change, processed frames are shown one run late if the post-processor is fast enough, otherwise
 * unprocessed frames. Runs never delay drawing: only the latest frame is passed on, when the post-processor is free.
 */
export class PostView implements FrameFilter {
  readonly #device: GPUDevice;
  readonly #request: PostRequest;
  readonly #post: PostProcessor;
  readonly #reader: StateReader;
  readonly #images: InputImages;
  /** The frames of the page, and those of another size that a script reads. */
  readonly #page = new Shown();
  #capture = new Shown();
  /** The frame that is the input of the current run, and its surface. */
  #pending: Shown | undefined;
  #pendingSurface: FilteredFrame | undefined;
  isPending = false;
  /**
   * State at the start of the last run, and of the last failed run. The failed state is not tried again. No state is
   * tried before the time `#retryAt`, in milliseconds of `performance.now()`.
   */
  #tried = '';
  #failed = '';
  #retryAt = 0;
  #retry: ReturnType<typeof setTimeout> | undefined;
  #isInTime = false;

  private constructor(device: GPUDevice, request: PostRequest, post: PostProcessor) {
    this.#device = device;
    this.#request = request;
    this.#post = post;
    const { models, input } = post;
    const { credentials, signal, onChange, onError } = request;
    this.#reader = new StateReader(models, onError);
    const given = new Set([input.name]);
    const whenIdle = (): Promise<void> => post.idle;
    const options = { credentials, signal, onChange, onError, whenIdle };
    this.#images = new InputImages(device, models.slice(0, 1), given, options);
  }

  /** Fetches and checks the post-processors. Rejects with GaussianSplatError, or the signal's reason. */
  static async open(request: PostRequest, device: GPUDevice): Promise<PostView> {
    const { urls, credentials, runtimeLocation, signal, onFallback, onError, onChange } = request;
    if (runtimeLocation !== null) setRuntimeLocation(new URL(runtimeLocation, document.baseURI));
    let view: PostView | undefined;
    const post = await PostProcessor.open(
      urls.map((url) => ({ url, credentials, openHeader: readsHeaders(request.loader, request.limits) })),
      device,
      {
        signal,
        gpuCheck: gpuCheckOf(request),
        onFallback,
        onImage: (image) => {
          if (view) view.#accept(image);
        },
        onError: (error) => {
          if (view) view.#fail();
          onError(error);
          onChange();
        },
      },
    );
    for (const { notes, url } of post.models)
      for (const note of notes) console.warn(`<gaussian-splat>: ${url}: ${note}.`);
    offerPanel(request.element);
    return (view = new PostView(device, request, post));
  }

  /** If the post-processor needs depth, the rasterizer must be `tiles`, the only one that writes it. */
  get settings(): FrameFilter['settings'] {
    return this.#post.depth && { rasterizer: 'tiles' };
  }

  get byteLength(): number {
    return (this.#page.surface?.byteLength ?? 0) + (this.#capture.surface?.byteLength ?? 0);
  }

  /** Inputs of the models, without the image of the frame, which the page does not set. */
  get inputs(): readonly GeneratorInput[] {
    return inputsOf(this.#post.models).filter(({ name }) => name !== this.#post.input.name);
  }

  render(frame: Frame, content: string, draw: (frame: Frame) => void): void {
    const shown = frame.isRead && !hasSizeOf(this.#page, frame) ? this.#capture : this.#page;
    const surface = this.#surfaceFor(shown, frame);
    const key = `${content} ${JSON.stringify(frame.camera)} ${String(frame.background)}`;
    if (key !== shown.drawn) draw({ ...frame, target: surface.drawn, depth: surface.depth });
    shown.drawn = key;
    if (!this.#post.isBusy && this.#isDue(key)) this.#offer(shown, surface, frame, key);
    this.isPending = shown.filtered !== key && this.#said(key) !== this.#failed;
    surface.present(this.#shows(shown, key) ? 'filtered' : 'drawn', frame.target);
  }

  get idle(): Promise<void> {
    return this.#post.idle;
  }

  forgetCapture(): void {
    this.#retire(this.#capture.surface);
    this.#capture = new Shown();
  }

  invalidate(): void {
    this.#page.drawn = this.#capture.drawn = '';
  }

  close(): void {
    clearTimeout(this.#retry);
    const { surface } = this.#page;
    this.#page.surface = undefined;
    this.#post.close();
    this.#images.destroy();
    this.#retire(surface);
    this.forgetCapture();
  }

  /**
   * Destroys a surface when no run reads it. Surfaces that are not the input of the current run are destroyed at once,
   * because many sizes may occur during one run.
   */
  #retire(surface: FilteredFrame | undefined): void {
    if (surface !== this.#pendingSurface || !this.#post.isBusy) surface?.destroy();
    else void this.#post.idle.then(() => surface?.destroy());
  }

  #surfaceFor(shown: Shown, frame: Frame): FilteredFrame {
    if (shown.surface && hasSizeOf(shown, frame)) return shown.surface;
    this.#retire(shown.surface);
    const { width, height } = frame.camera;
    const surface = new FilteredFrame(this.#device, width, height, this.#post.depth !== undefined);
    Object.assign(shown, new Shown(), { surface });
    return surface;
  }

  /** Returns a key of all values that a run depends on: the frame, controls, time and images. */
  #said(key: string): string {
    const { controls, images, timeSeconds } = this.#request.state();
    return `${key} ${JSON.stringify([controls, timeSeconds])} ${String(Object.values(images))}`;
  }

  /**
   * Returns whether a run may start. False for a state that has failed, and for {@link RETRY_MS} after any failure; a
   * frame is then requested at the end of that time.
   */
  #isDue(key: string): boolean {
    const waitMs = this.#retryAt - performance.now();
    if (this.#said(key) === this.#failed) return false;
    clearTimeout(this.#retry);
    if (waitMs > 0) this.#retry = setTimeout(() => this.#request.onChange(), waitMs);
    return waitMs <= 0;
  }

  /** Passes the drawn frame and the state of the page to the post-processor, which runs if any of them has changed. */
  #offer(shown: Shown, surface: FilteredFrame, { camera }: Frame, key: string): void {
    this.#tried = this.#said(key);
    const { input } = this.#post;
    const state = this.#request.state();
    this.#images.update(state.images);
    if (shown.tensor === undefined || shown.handed !== shown.drawn) {
      const { width = surface.width, height = surface.height, dtype, channels } = input;
      shown.tensor = surface.handOver({ width, height, dtype, channels });
      const { depth } = this.#post;
      shown.depth =
        depth &&
        surface.handOverDepth({
          width: depth.width ?? surface.width,
          height: depth.height ?? surface.height,
          dtype: depth.dtype,
        });
      shown.handed = shown.drawn;
    }
    [this.#pending, this.#pendingSurface] = [shown, surface];
    const scenes = this.#request.shown();
    // Names of other models' inputs are not reported as unknown.
    const others = scenes.flatMap(({ settable }) => settable ?? []);
    try {
      this.#post.follow(scenes.find(({ generator }) => generator)?.generator);
      const read = this.#reader.read(state, camera, this.#images.tensors, others);
      this.#post.request(shown.tensor, { ...read, depth: shown.depth });
    } catch (error) {
      this.#failed = this.#tried;
      this.#request.onError(error);
    }
    void this.#post.idle.then(() => {
      // The frame or the page's values have changed during the run.
      if (this.#said(shown.drawn) !== this.#tried || this.#post.isConverging) this.#request.onChange();
    });
  }

  #accept(image: GpuTensor): void {
    const [shown, surface] = [this.#pending, this.#pendingSurface];
    // The element may have been resized during the run.
    if (!shown || !surface || shown.surface !== surface || image.dtype === 'int32') return;
    const { buffer, dims, dtype } = image;
    surface.accept({ buffer, dims, dtype });
    shown.filtered = shown.handed;
    this.#request.onChange();
  }

  #fail(): void {
    if (this.#pending) this.#pending.filtered = '';
    this.#failed = this.#tried;
    this.#retryAt = performance.now() + RETRY_MS;
  }

  #shows({ filtered }: Shown, key: string): boolean {
    const { milliseconds = Infinity } = this.#post;
    this.#isInTime = milliseconds <= (this.#isInTime ? TOO_LATE_MS : IN_TIME_MS);
    return filtered !== '' && (filtered === key || this.#isInTime);
  }
}

const hasSizeOf = ({ surface }: Shown, { camera: { width, height } }: Frame): boolean =>
  surface?.width === width && surface.height === height;
