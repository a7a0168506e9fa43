/** Types of the part of WebXR in use, which TypeScript does not provide. */

export type XrMode = 'immersive-vr' | 'immersive-ar';

export interface XrSystem extends EventTarget {
  isSessionSupported(mode: XrMode): Promise<boolean>;
  requestSession(mode: XrMode, options?: object): Promise<XrSession>;
  /** Shows a button of the browser. Fulfills when the visitor presses it; rejects if another request replaces it. */
  offerSession?(mode: XrMode, options?: object): Promise<XrSession>;
}

export interface XrSession extends EventTarget {
  readonly inputSources: Iterable<XrInput>;
  readonly frameRate?: number | undefined;
  /** Refresh rates that {@link updateTargetFrameRate} accepts, Hz. */
  readonly supportedFrameRates?: Iterable<number> | undefined;
  updateTargetFrameRate?(rate: number): Promise<void>;
  readonly environmentBlendMode?: string;
  readonly enabledFeatures?: readonly string[];
  requestAnimationFrame(callback: (time: number, frame: XrFrame) => void): number;
  requestReferenceSpace(type: string): Promise<XrSpace>;
  requestHitTestSource?(options: object): Promise<XrHitTestSource>;
  updateRenderState(state: object): void;
  end(): Promise<void>;
}

export interface XrHitTestSource {
  cancel(): void;
}

export interface XrHit {
  getPose(space: XrSpace): XrPose | undefined;
  createAnchor?(): Promise<XrAnchor>;
}

export interface XrAnchor {
  readonly anchorSpace: XrSpace;
  delete(): void;
}

export type XrSpace = EventTarget;

export interface XrPose {
  readonly transform: XrTransform;
}

export interface XrTransform {
  readonly position: { readonly x: number; readonly y: number; readonly z: number };
  /** 4x4 matrix, column-major. */
  readonly matrix: Float32Array;
  readonly inverse: XrTransform;
}

export interface XrView extends XrPose {
  readonly eye: string;
  readonly projectionMatrix: Float32Array;
}

export interface XrFrame {
  readonly session: XrSession;
  getViewerPose(space: XrSpace): (XrPose & { readonly views: readonly XrView[] }) | undefined | null;
  getPose(space: XrSpace, base: XrSpace): XrPose | undefined | null;
  getHitTestResults?(source: XrHitTestSource): readonly XrHit[];
}

export interface XrInput {
  readonly handedness: string;
  readonly targetRayMode?: string;
  readonly targetRaySpace: XrSpace;
  /** Pose of the hand that holds the input. */
  readonly gripSpace?: XrSpace | null | undefined;
  readonly gamepad?: Gamepad | null | undefined;
}

/** Event of an input, such as `selectstart`. */
export interface XrInputEvent extends Event {
  readonly inputSource: XrInput;
}

export interface XrViewport {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

export interface XrLayer {
  readonly framebuffer: WebGLFramebuffer | null;
  readonly framebufferWidth: number;
  readonly framebufferHeight: number;
  getViewport(view: XrView): XrViewport | null;
}

/** WebGPU's counterpart of `XRWebGLLayer`: <https://immersive-web.github.io/WebXR-WebGPU-Binding/>. */
export interface XrGpuBinding {
  getPreferredColorFormat(): GPUTextureFormat | null;
  createProjectionLayer(options: { readonly colorFormat: GPUTextureFormat }): object;
  getViewSubImage(layer: object, view: XrView): XrGpuSubImage;
}

/** The part of a texture that belongs to a view. */
export interface XrGpuSubImage {
  readonly colorTexture: GPUTexture;
  readonly viewport: XrViewport;
  getViewDescriptor(): GPUTextureViewDescriptor;
}

type GpuBindingClass = new (session: XrSession, device: GPUDevice) => XrGpuBinding;

type LayerClass = new (session: XrSession, gl: WebGL2RenderingContext, options: object) => XrLayer;

export const xrOf = (view: Window | null): XrSystem | undefined =>
  (view?.navigator as { xr?: XrSystem } | undefined)?.xr;

export const makeLayer = (session: XrSession, gl: WebGL2RenderingContext): XrLayer => {
  const { XRWebGLLayer } = globalThis as unknown as { XRWebGLLayer: LayerClass };
  // The renderer blends the splats in a texture of its own. Multisampling and depth of the layer would be unused.
  return new XRWebGLLayer(session, gl, { antialias: false, depth: false, stencil: false, ignoreDepthValues: true });
};

/** Returns the class of the WebXR-WebGPU binding; undefined in browsers without it. */
export const gpuBindingClass = (): GpuBindingClass | undefined =>
  (globalThis as { XRGPUBinding?: GpuBindingClass }).XRGPUBinding;
