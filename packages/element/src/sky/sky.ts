/** Loaded where an element has the attribute `skybox-image`: an environment behind the scene. */
import { bytesOf, fetchPatiently } from '@gaussian-splat/core/fetch';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { credentialsOf, type Attributes } from '../attributes.js';
import type { ViewerFrame } from '../camera/orbit.js';
import type { Mover } from '../controllers/motion.js';
import type { Backend } from '../gpu/backend.js';
import type { Frame } from '../dynamic/frame-filter.js';
import type { WebGlBackend } from '../webgl/webgl-backend.js';
import { SkyGl } from './sky-gl.js';
import { hasTarget, SkyGpu } from './sky-gpu.js';

/** Bytes of a file. */
const MAX_BYTES = 2 ** 26;

/** Interface of the element for a sky. */
export interface SkyHost {
  readonly element: ReactiveControllerHost & HTMLElement;
  readonly attributes: Pick<Attributes, 'skyboxImage' | 'crossorigin'>;
  readonly frame: ViewerFrame;
  readonly view: { readonly backend: Backend | null };
  readonly behaviors: { add(mover: Mover): void };
  requestFrame(): void;
  warn(sentence: string): void;
}

/** Fetches the image, and draws it beneath the splats with what draws these. */
export class Sky implements ReactiveController, Mover {
  readonly #host: SkyHost;
  #url: string | null = null;
  #image: ImageBitmap | undefined;
  #gpu: SkyGpu | undefined;
  #gl: SkyGl | undefined;

  constructor(host: SkyHost) {
    this.#host = host;
    host.element.addController(this);
    host.behaviors.add(this);
    this.hostUpdated();
  }

  hostUpdated(): void {
    const { skyboxImage: url } = this.#host.attributes;
    if (url === this.#url) return;
    this.#url = url;
    if (url) void this.#load(url);
    else this.#show(undefined);
  }

  /** Puts the sky beneath splats that WebGL draws, before each frame. */
  advance(): boolean {
    const { backend } = this.#host.view;
    if (!backend || backend.isLost || !(backend.place.context instanceof WebGL2RenderingContext)) return false;
    const { beneath } = backend as WebGlBackend;
    const sky = this.#image && this.#glOn(backend.place.context, this.#image);
    beneath.sky = sky && ((camera) => sky.draw(camera, this.#host.frame));
    return false;
  }

  /** Draws it into the target of a frame. @returns what is behind the splats then */
  draw(frame: Frame): Partial<FrameTarget> {
    const { backend } = this.#host.view;
    if (!this.#image || !backend || !hasTarget(frame)) return {};
    const { device } = backend;
    if (this.#gpu?.device !== device) {
      this.#gpu?.destroy();
      this.#gpu = new SkyGpu(device, this.#image);
    }
    return this.#gpu.draw(frame, this.#host.frame);
  }

  #glOn(gl: WebGL2RenderingContext, image: ImageBitmap): SkyGl {
    if (this.#gl?.gl === gl) return this.#gl;
    this.#gl?.destroy();
    return (this.#gl = new SkyGl(gl, image));
  }

  async #load(url: string): Promise<void> {
    const { element, attributes, view } = this.#host;
    try {
      const address = new URL(url, element.baseURI);
      const response = await fetchPatiently(address, { credentials: credentialsOf(attributes.crossorigin) });
      if (!response.ok) throw new Error(`expected an image at ${address.href}, found status ${response.status}`);
      const image = await decode(await bytesOf(response, undefined, MAX_BYTES), view.backend);
      if (url === this.#url) this.#show(image);
    } catch (error) {
      if (url !== this.#url) return;
      this.#show(undefined);
      this.#host.warn(`<gaussian-splat> skybox-image: ${error instanceof Error ? error.message : String(error)}`);
    }
  }

  /** @param image undefined for none */
  #show(image: ImageBitmap | undefined): void {
    this.#image?.close();
    this.#image = image;
    this.#gpu?.destroy();
    this.#gl?.destroy();
    this.#gpu = this.#gl = undefined;
    this.#host.view.backend?.filter?.invalidate();
    this.#host.requestFrame();
  }
}

/** An image that the GPU can hold. */
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
