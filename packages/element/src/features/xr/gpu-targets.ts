import { contextFor, unsupported } from './xr-scene.js';
import {
  gpuBindingClass,
  makeLayer,
  type XrFrame,
  type XrGpuBinding,
  type XrLayer,
  type XrSession,
  type XrView,
  type XrViewport,
} from './webxr.js';

/** Part of a texture into which a view is drawn. */
export interface GpuImage {
  readonly texture: GPUTextureView;
  /** Rectangle in pixels from the upper left corner of the texture. */
  readonly at: XrViewport;
}

/** Textures into which the views of a WebGPU session are drawn. */
export interface GpuTarget {
  readonly clipDepth: '0..1' | '-1..1';
  readonly renderState: object;
  readonly format: GPUTextureFormat;
  /** Called if the target is lost, with a description of the loss. */
  onLost: (what: string) => void;
  /** Begins a frame. @returns the image of each view in this frame */
  begin(frame: XrFrame, views: readonly XrView[]): Map<XrView, GpuImage>;
  /** Presents the frame. */
  end(): void;
  destroy(): void;
}

/** Textures that the session itself provides, through the WebXR-WebGPU binding. */
export class BindingTarget implements GpuTarget {
  readonly clipDepth = '0..1';
  onLost: (what: string) => void = () => undefined;
  readonly renderState: { readonly layers: readonly object[] };
  readonly format: GPUTextureFormat;
  readonly #binding: XrGpuBinding;
  readonly #layer: object;

  constructor(session: XrSession, device: GPUDevice) {
    const Binding = gpuBindingClass();
    if (!Binding) throw unsupported('XRGPUBinding', 'none');
    this.#binding = new Binding(session, device);
    this.format = this.#binding.getPreferredColorFormat() ?? navigator.gpu.getPreferredCanvasFormat();
    this.#layer = this.#binding.createProjectionLayer({ colorFormat: this.format });
    this.renderState = { layers: [this.#layer] };
  }

  begin(_frame: XrFrame, views: readonly XrView[]): Map<XrView, GpuImage> {
    return new Map(
      views.map((view) => {
        const image = this.#binding.getViewSubImage(this.#layer, view);
        const texture = image.colorTexture.createView(image.getViewDescriptor());
        return [view, { texture, at: image.viewport }];
      }),
    );
  }

  end(): void {
    // The session presents its textures itself.
  }

  destroy(): void {
    // The session owns its textures.
  }
}

/** A WebGPU canvas that is copied to the WebGL layer of the session, for browsers without the binding. */
export class CopyTarget implements GpuTarget {
  readonly clipDepth = '-1..1';
  onLost: (what: string) => void = () => undefined;
  readonly renderState: { readonly baseLayer: XrLayer };
  readonly format = navigator.gpu.getPreferredCanvasFormat();
  readonly #gl: WebGL2RenderingContext;
  readonly #layer: XrLayer;
  readonly #size: { readonly width: number; readonly height: number };
  /** Context of a canvas that nothing else refers to, until the session ends. */
  #context: GPUCanvasContext | undefined;
  readonly #copied: WebGLFramebuffer;

  private constructor(session: XrSession, device: GPUDevice, gl: WebGL2RenderingContext) {
    this.#gl = gl;
    gl.canvas.addEventListener('webglcontextlost', () => this.onLost('the WebGL context was lost'), { once: true });
    this.#layer = makeLayer(session, gl);
    this.renderState = { baseLayer: this.#layer };
    const { framebufferWidth: width, framebufferHeight: height } = this.#layer;
    this.#size = { width, height };
    const context = new OffscreenCanvas(width, height).getContext('webgpu');
    if (!context) throw unsupported('a WebGPU canvas', 'none');
    context.configure({ device, format: this.format, alphaMode: 'opaque' });
    this.#context = context;
    this.#copied = gl.createFramebuffer();
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#copied);
    const texture = gl.getParameter(gl.TEXTURE_BINDING_2D) as WebGLTexture;
    gl.framebufferTexture2D(gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  }

  static async open(session: XrSession, device: GPUDevice): Promise<CopyTarget> {
    return new CopyTarget(session, device, (await contextFor(null)).gl);
  }

  begin(_frame: XrFrame, views: readonly XrView[]): Map<XrView, GpuImage> {
    const texture = this.#context!.getCurrentTexture().createView();
    return new Map(
      views.flatMap((view) => {
        const at = this.#layer.getViewport(view);
        if (!at) return [];
        const { x, width, height } = at;
        // WebGL counts rows from below.
        return [[view, { texture, at: { x, y: this.#size.height - at.y - height, width, height } }]];
      }),
    );
  }

  end(): void {
    const gl = this.#gl;
    const { width, height } = this.#size;
    // An ImageBitmap is a faster source than the canvas itself.
    const image = (this.#context!.canvas as OffscreenCanvas).transferToImageBitmap();
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, gl.RGBA, gl.UNSIGNED_BYTE, image);
    image.close();
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#copied);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.#layer.framebuffer);
    gl.blitFramebuffer(0, 0, width, height, 0, height, width, 0, gl.COLOR_BUFFER_BIT, gl.NEAREST);
  }

  destroy(): void {
    this.onLost = () => undefined;
    this.#context?.unconfigure();
    this.#context = undefined;
    this.#gl.getExtension('WEBGL_lose_context')?.loseContext();
  }
}
