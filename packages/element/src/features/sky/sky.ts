/** Environment image behind the scene. Loaded for elements with the attribute `skybox-image`. */
import { bytesOf, fetchPatiently } from '@gaussian-splat/core/fetch';
import { boundedImageHeader } from '@gaussian-splat/formats';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ReactiveController } from 'lit';
import { credentialsOf } from '../../viewer/attributes.js';
import type { Feature } from '../../viewer/features.js';
import type { Viewer } from '../../viewer/viewer.js';
import { LatestTask } from '../../viewer/latest-task.js';
import type { Frame } from '../../sources/generator/frame-filter.js';
import type { Backend } from '../../gpu/backend.js';
import type { WebGlBackend } from '../../webgl/webgl-backend.js';
import { SkyGl } from './sky-gl.js';
import { hasTarget, SkyGpu } from './sky-gpu.js';

/** Maximum size of the image file, bytes. */
const MAX_BYTES = 2 ** 26;

/** Fetches the image, and draws it beneath the splats with the API that draws the splats. */
export class Sky implements ReactiveController, Feature {
  readonly #viewer: Viewer;
  readonly #loading = new LatestTask();
  #url: string | null = null;
  #image: ImageBitmap | undefined;
  #gpu: SkyGpu | undefined;
  #gl: SkyGl | undefined;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    const { element } = viewer;
    element.addController(this);
    // Without a scene nothing is drawn, so that the sky must not wait for a frame to be freed.
    element.addEventListener('emptied', () => viewer.view.backend === null && this.#free());
    this.hostUpdated();
  }

  hostUpdated(): void {
    const { skyboxImage: url } = this.#viewer.attributes;
    if (url === this.#url) return;
    this.#url = url;
    if (url) return this.#loading.run((signal) => this.#load(url, signal), this.#fail);
    this.#loading.renew();
    this.#show(undefined);
  }

  /** Attaches the sky to splats that WebGL draws. */
  prepareFrame(): void {
    const { backend } = this.#viewer.view;
    if (!backend || backend.place.isLost || !(backend.place.context instanceof WebGL2RenderingContext)) return;
    const { beneath } = backend as WebGlBackend;
    const sky = this.#image && this.#glOn(backend.place.context, this.#image);
    beneath.sky = sky && ((camera) => sky.draw(camera, this.#viewer.frame));
  }

  /**
   * Draws the sky into the target of a WebGPU frame.
   * @returns properties of the target that let the splats blend over the sky; none without a sky
   */
  drawBeneath(frame: Frame): Partial<FrameTarget> {
    const { backend } = this.#viewer.view;
    if (!this.#image || !backend || !hasTarget(frame)) return {};
    const { device } = backend;
    if (this.#gpu?.device !== device) {
      this.#gpu?.destroy();
      this.#gpu = new SkyGpu(device, this.#image);
    }
    return this.#gpu.draw(frame, this.#viewer.frame);
  }

  #glOn(gl: WebGL2RenderingContext, image: ImageBitmap): SkyGl {
    if (this.#gl?.gl === gl) return this.#gl;
    this.#gl?.destroy();
    return (this.#gl = new SkyGl(gl, image));
  }

  async #load(url: string, signal: AbortSignal): Promise<void> {
    const { element, attributes, view } = this.#viewer;
    const address = new URL(url, element.baseURI);
    const response = await fetchPatiently(address, { credentials: credentialsOf(attributes.crossorigin), signal });
    if (!response.ok) throw new Error(`expected an image at ${address.href}, found status ${response.status}`);
    const bytes = await bytesOf(response, undefined, MAX_BYTES);
    if (boundedImageHeader(bytes, address.href) === undefined)
      throw new Error(`expected a JPEG, PNG, WebP or AVIF image at ${address.href}, found another file`);
    const image = await decode(bytes, view.backend);
    if (signal.aborted) image.close();
    else this.#show(image);
  }

  readonly #fail = (error: unknown): void => {
    this.#show(undefined);
    this.#viewer.warn(`<gaussian-splat> skybox-image: ${error instanceof Error ? error.message : String(error)}`);
  };

  /** Frees the GPU memory. The next frame uploads the image again. */
  #free(): void {
    this.#gpu?.destroy();
    this.#gl?.destroy();
    this.#gpu = this.#gl = undefined;
  }

  /** Replaces the image. @param image undefined for no sky */
  #show(image: ImageBitmap | undefined): void {
    this.#image?.close();
    this.#image = image;
    this.#free();
    this.#viewer.view.backend?.filter?.invalidate();
    this.#viewer.requestFrame();
  }
}

/** Decodes an image file, and reduces an image that exceeds the maximum texture size of the GPU. */
async function decode(bytes: Uint8Array<ArrayBuffer>, backend: Backend | null): Promise<ImageBitmap> {
  const blob = new Blob([bytes]);
  const image = await createImageBitmap(blob);
  const max = backend?.place.limits.maxTextureDimension2D ?? 4096;
  if (Math.max(image.width, image.height) <= max) return image;
  const scale = max / Math.max(image.width, image.height);
  const side = (length: number): number => Math.max(1, Math.floor(scale * length));
  const size = { resizeWidth: side(image.width), resizeHeight: side(image.height) };
  image.close();
  return createImageBitmap(blob, { ...size, resizeQuality: 'high' });
}
