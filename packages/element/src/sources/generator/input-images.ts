import { GaussianSplatError } from '@gaussian-splat/core';
import { boundedImageHeader } from '@gaussian-splat/formats';
import { imageShapeOf, type GeneratorModel, type GpuTensor } from '@gaussian-splat/generator';
import { ImageTensor, type ImageShape } from '@gaussian-splat/renderer';
import { fetchBeside } from './model-files.js';
import { valueOf, type ImageSource, type ImageSources } from './values.js';

/** Maximum size of an image file in bytes. */
const MAX_IMAGE = 2 ** 28;

export interface InputImagesOptions {
  readonly credentials: RequestCredentials;
  readonly signal: AbortSignal;
  /** Called when no image is in transit any more: all have arrived or failed. */
  readonly onChange: () => void;
  readonly onError: (error: unknown) => void;
  /** Resolves when no run of a model reads an image. */
  readonly whenIdle: () => Promise<void>;
}

/** Shape of an image tensor, with the sizes that the model fixes. */
type WantedShape = ReturnType<typeof imageShapeOf>;

/**
 * The image inputs of models. Images that the page sets are fetched, cropped to the model's proportions, and resampled
 * on the GPU.
 */
export class InputImages {
  readonly #device: GPUDevice;
  readonly #options: InputImagesOptions;
  readonly #shapes = new Map<string, WantedShape>();
  readonly #sources = new Map<string, ImageSources>();
  readonly #tensors: Record<string, ImageTensor> = {};
  /** Loads of the current images, by the names of the inputs. */
  readonly #loading = new Map<string, Promise<void>>();
  #isDestroyed = false;

  /**
   * @param models Models whose image inputs the page sets.
   * @param given Names of inputs that the page does not set.
   */
  constructor(
    device: GPUDevice,
    models: readonly GeneratorModel[],
    given: ReadonlySet<string>,
    options: InputImagesOptions,
  ) {
    this.#device = device;
    this.#options = options;
    for (const { header, contract } of models) {
      for (const input of header.inputs) {
        if (contract.inputs[input.name].role !== 'image' || given.has(input.name)) continue;
        this.#shapes.set(input.name, imageShapeOf(input));
      }
    }
  }

  /** Tensors of the images that have arrived, by the names of the inputs. */
  get tensors(): Readonly<Record<string, GpuTensor>> {
    return this.#tensors;
  }

  /** Whether an image is in transit. Other values that the page has set may belong to that image. */
  get isLoading(): boolean {
    return this.#loading.size > 0;
  }

  /** Whether every image input has its images, and no image is in transit. */
  get areComplete(): boolean {
    return !this.isLoading && [...this.#shapes.keys()].every((name) => name in this.#tensors);
  }

  /** Resolves when no image is in transit. Never rejects. */
  async settled(): Promise<void> {
    while (this.#loading.size > 0) await Promise.all(this.#loading.values());
  }

  /** Sets the images by the names of inputs. Only images that have changed are loaded. */
  update(images: Readonly<Record<string, ImageSources>>): void {
    for (const name of this.#shapes.keys()) {
      const source = valueOf(images, name);
      if (source === undefined || isSame(source, this.#sources.get(name))) continue;
      this.#sources.set(name, source);
      const loading: Promise<void> = this.#load(name, source).finally(() => {
        // An image that was replaced before it arrived does not delay its successor.
        if (this.#loading.get(name) !== loading) return;
        this.#loading.delete(name);
        if (!this.isLoading && !this.#isDestroyed) this.#options.onChange();
      });
      this.#loading.set(name, loading);
    }
  }

  /** Frees the tensors when no run reads them. Call after the model is closed. */
  destroy(): void {
    this.#isDestroyed = true;
    void this.#options.whenIdle().then(() => Object.values(this.#tensors).forEach((tensor) => tensor.destroy()));
  }

  async #load(name: string, source: ImageSources): Promise<void> {
    try {
      const sources = listed(name, source, this.#shapes.get(name)!.views);
      const made: ImageBitmap[] = [];
      try {
        const all = await Promise.all(
          sources.map(async (each) => {
            const pixels = await pixelsOf(name, each, this.#options);
            if (pixels !== each && pixels instanceof ImageBitmap) made.push(pixels);
            return pixels;
          }),
        );
        if (this.#isDestroyed || this.#sources.get(name) !== source) return;
        const tensor = this.#tensorFor(name, all[0]);
        all.forEach((pixels, view) => {
          tensor.upload(pixels, 'cover', view);
          if (pixels instanceof HTMLVideoElement) this.#follow(name, source, pixels, view);
        });
      } finally {
        // Decoded images are closed in any case, also if the page has replaced them.
        for (const pixels of made) pixels.close();
      }
    } catch (error) {
      // The failure of an image that the page has replaced meanwhile is not reported.
      const isCurrent = this.#sources.get(name) === source;
      if (isCurrent && !this.#isDestroyed && !this.#options.signal.aborted) this.#options.onError(error);
    }
  }

  /** Uploads each later frame of a video, between two runs. Frames that arrive during a run are left out. */
  #follow(name: string, source: ImageSources, video: HTMLVideoElement, view: number): void {
    const upload = (): void => {
      if (this.#isDestroyed || this.#sources.get(name) !== source) return;
      this.#tensorFor(name, video).upload(video, 'cover', view);
      this.#options.onChange();
      this.#follow(name, source, video, view);
    };
    video.requestVideoFrameCallback(() => void this.#options.whenIdle().then(upload).catch(this.#options.onError));
  }

  #tensorFor(name: string, pixels: GPUCopyExternalImageSource): ImageTensor {
    const wanted = this.#shapes.get(name)!;
    const own = ownSize(pixels);
    const shape: ImageShape = { ...wanted, width: wanted.width ?? own.width, height: wanted.height ?? own.height };
    const found = this.#tensors[name] as ImageTensor | undefined;
    if (found?.shape.width === shape.width && found.shape.height === shape.height) return found;
    void this.#options.whenIdle().then(() => found?.destroy());
    return (this.#tensors[name] = new ImageTensor(this.#device, shape));
  }
}

/**
 * Returns the images of an input, from a list, or from addresses separated by spaces. Throws GaussianSplatError
 * `argument/value` if there are not as many as the input has views.
 */
function listed(name: string, source: ImageSources, views: number): readonly ImageSource[] {
  const text = typeof source === 'string' && views > 1 ? source.trim().split(/\s+/) : source;
  const list = Array.isArray(text) ? (text as readonly ImageSource[]) : [text as ImageSource];
  if (list.length === views) return list;
  throw new GaussianSplatError('argument/value', {
    where: `control ${name}`,
    expected: `${views} image${views > 1 ? 's' : ''}`,
    found: `${list.length}`,
    remedy: views > 1 ? 'name all of them, with spaces between their addresses, or as a list' : 'name one',
  });
}

/**
 * Returns whether two values name the same images. Lists are compared by their elements, because a page creates new
 * lists whenever it sets its controls.
 */
function isSame(a: ImageSources, b: ImageSources | undefined): boolean {
  if (!Array.isArray(a) || !Array.isArray(b)) return a === b;
  return a.length === b.length && a.every((each, i) => each === (b as readonly ImageSource[])[i]);
}

async function pixelsOf(
  name: string,
  source: ImageSource,
  options: InputImagesOptions,
): Promise<GPUCopyExternalImageSource> {
  if (source instanceof HTMLImageElement) {
    await source.decode().catch((cause: unknown) => {
      throw unreadable(name, source.src, cause);
    });
    return source;
  }
  if (typeof source !== 'string' && !(source instanceof Blob)) return source;
  const blob = typeof source === 'string' ? await fetchImage(source, options) : source;
  const fail = (cause: unknown): never => {
    throw unreadable(name, typeof source === 'string' ? source : source.type, cause);
  };
  const header = boundedImageHeader(new Uint8Array(await blob.arrayBuffer()), `control ${name}`);
  // Other formats have no bound, for example a GIF of a few bytes that takes gigabytes after decoding.
  if (header === undefined) return fail(new Error('the header is that of another format'));
  // The image is rotated as the file declares.
  return createImageBitmap(blob, { imageOrientation: 'from-image', premultiplyAlpha: 'premultiply' }).catch(fail);
}

async function fetchImage(url: string, options: InputImagesOptions): Promise<Blob> {
  return new Blob([
    await fetchBeside(url, options, MAX_IMAGE, 'the image that the control names', 'check the address'),
  ]);
}

function ownSize(pixels: GPUCopyExternalImageSource): { width: number; height: number } {
  if ('displayWidth' in pixels) return { width: pixels.displayWidth, height: pixels.displayHeight };
  if ('videoWidth' in pixels) return { width: pixels.videoWidth, height: pixels.videoHeight };
  if ('naturalWidth' in pixels) return { width: pixels.naturalWidth, height: pixels.naturalHeight };
  return { width: pixels.width, height: pixels.height };
}

const unreadable = (name: string, found: string, cause: unknown): GaussianSplatError =>
  new GaussianSplatError('decode/unknown-format', {
    where: `control ${name}`,
    expected: 'a PNG, JPEG, WebP or AVIF image that this browser reads',
    found: `${found.slice(0, 200)} (${(cause as Error)?.message ?? 'unknown cause'})`,
    remedy: 'save the image in one of these formats',
    cause,
  });
