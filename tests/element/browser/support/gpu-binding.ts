/**
 * A fake `XRGPUBinding` over the emulated headset, whose textures are those of the page's own device: what browsers have behind a flag, by the draft of
 * https://immersive-web.github.io/WebXR-WebGPU-Binding/.
 */
import { EYE, headset } from './headset.js';

export type Layout = 'array' | 'side-by-side';
export type Grant = 'granted' | 'not granted' | 'refused' | 'broken';

export interface FakeBinding {
  /** Optional features of each request for a session. */
  readonly asked: string[][];
  /** Feature lists of the sessions that were started. */
  readonly enabled: string[][];
  /** Validation and other errors of the device. */
  readonly errors: string[];
  /** Size of an eye's viewport. */
  readonly size: { readonly width: number; readonly height: number };
  /** Number of frames until now. */
  readonly frames: number;
  /** Whether the last adapter was asked for as compatible with headsets. */
  readonly isCompatible: boolean;
  pixels(eye: 'left' | 'right'): Promise<Uint8Array>;
  remove(): void;
}

interface View {
  readonly eye: 'left' | 'right';
}
interface Session {
  readonly enabledFeatures: string[];
  updateRenderState(state: object): void;
}
type Ask = (mode: string, options: { optionalFeatures: string[] }) => Promise<Session>;

const FORMAT = 'rgba8unorm';

let wasCompatible = false;
const { requestAdapter } = GPU.prototype;
GPU.prototype.requestAdapter = function (options) {
  wasCompatible = (options as { xrCompatible?: boolean } | undefined)?.xrCompatible === true;
  return requestAdapter.call(this, options);
};

/** @param share of the width and height of an eye's texture that its viewport covers */
export function fakeBinding(layout: Layout, share: number, grant: Grant = 'granted'): FakeBinding {
  const xr = (navigator as unknown as { xr: { requestSession: Ask } }).xr;
  const { XRSession, XRWebGLLayer, XRView } = globalThis as unknown as Record<string, { prototype: object }>;
  const { requestSession } = xr;
  const { updateRenderState } = XRSession.prototype as Session;
  const features = Object.getOwnPropertyDescriptor(XRSession.prototype, 'enabledFeatures')!;
  const projection = Object.getOwnPropertyDescriptor(XRView.prototype, 'projectionMatrix')!;
  const withGpu = new WeakSet<object>();
  const size = { width: Math.round(share * EYE.width), height: Math.round(share * EYE.height) };
  const [asked, enabled, errors]: [string[][], string[][], string[]] = [[], [], []];
  let [texture, device]: [GPUTexture | undefined, GPUDevice | undefined] = [undefined, undefined];
  let frames = 0;

  xr.requestSession = (mode, options) => {
    asked.push(options.optionalFeatures);
    const wants = options.optionalFeatures.includes('webgpu');
    if (wants && grant === 'refused') return Promise.reject(new DOMException('no', 'NotSupportedError'));
    return requestSession.call(xr, mode, options).then((session) => {
      if (wants && grant !== 'not granted') withGpu.add(session);
      enabled.push(session.enabledFeatures);
      return session;
    });
  };
  Object.defineProperty(XRSession.prototype, 'enabledFeatures', {
    configurable: true,
    get(this: Session) {
      return [...(features.get!.call(this) as string[]), ...(withGpu.has(this) ? ['webgpu'] : [])];
    },
  });
  // So slow that no number of pixels is too many on any machine.
  const rate = Object.getOwnPropertyDescriptor(XRSession.prototype, 'frameRate')!;
  Object.defineProperty(XRSession.prototype, 'frameRate', { configurable: true, get: () => 0.1 });
  // Projections of such sessions have a depth of 0 to 1.
  Object.defineProperty(XRView.prototype, 'projectionMatrix', {
    configurable: true,
    get(this: View) {
      const matrix = projection.get!.call(this) as Float32Array;
      if (!texture) return matrix;
      const [near, far] = [0.05, 1000];
      matrix[10] = -far / (far - near);
      matrix[14] = (-far * near) / (far - near);
      return matrix;
    },
  });
  // The emulator has no frames without a WebGL layer.
  (XRSession.prototype as Session).updateRenderState = function (this: Session, state: { layers?: object[] }) {
    if (!state.layers) return updateRenderState.call(this, state);
    if (!withGpu.has(this)) throw new DOMException('layers without webgpu', 'NotSupportedError');
    const gl = document.createElement('canvas').getContext('webgl2')!;
    const Layer = XRWebGLLayer as unknown as new (session: object, gl: WebGL2RenderingContext) => object;
    updateRenderState.call(this, { ...state, baseLayer: new Layer(this, gl) });
  };

  class Binding {
    constructor(session: object, on: GPUDevice) {
      if (!withGpu.has(session)) throw new DOMException('a session without webgpu', 'InvalidStateError');
      if (grant === 'broken') throw new DOMException('no XR device', 'InvalidStateError');
      device = on;
      on.addEventListener('uncapturederror', ({ error }) => errors.push(error.message));
    }

    getPreferredColorFormat(): GPUTextureFormat {
      return FORMAT;
    }

    createProjectionLayer({ colorFormat }: { colorFormat: GPUTextureFormat }): object {
      const isArray = layout === 'array';
      texture = device!.createTexture({
        size: isArray ? [EYE.width, EYE.height, 2] : [2 * EYE.width, EYE.height],
        format: colorFormat,
        usage: GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC,
      });
      return { isLayer: true };
    }

    getViewSubImage(_layer: object, { eye }: View): object {
      const isRight = eye === 'right';
      if (isRight) frames++;
      const isArray = layout === 'array';
      return {
        colorTexture: texture,
        viewport: { x: isRight && !isArray ? EYE.width : 0, y: 0, ...size },
        getViewDescriptor: () => ({
          dimension: '2d',
          mipLevelCount: 1,
          arrayLayerCount: 1,
          baseArrayLayer: isRight && isArray ? 1 : 0,
        }),
      };
    }
  }
  Object.assign(globalThis, { XRGPUBinding: Binding });
  headset();

  return {
    asked,
    enabled,
    errors,
    size,
    get frames() {
      return frames;
    },
    get isCompatible() {
      return wasCompatible;
    },
    async pixels(eye) {
      const { width, height } = size;
      const bytesPerRow = 256 * Math.ceil((4 * width) / 256);
      const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
      const staging = device!.createBuffer({ size: bytesPerRow * height, usage });
      const encoder = device!.createCommandEncoder();
      const [x, z] = eye === 'left' ? [0, 0] : layout === 'array' ? [0, 1] : [EYE.width, 0];
      encoder.copyTextureToBuffer({ texture: texture!, origin: [x, 0, z] }, { buffer: staging, bytesPerRow }, [
        width,
        height,
      ]);
      device!.queue.submit([encoder.finish()]);
      await staging.mapAsync(GPUMapMode.READ);
      const rows = new Uint8Array(staging.getMappedRange());
      const bytes = new Uint8Array(4 * width * height);
      for (let y = 0; y < height; y++)
        bytes.set(rows.subarray(y * bytesPerRow, y * bytesPerRow + 4 * width), 4 * width * y);
      staging.destroy();
      return bytes;
    },
    remove() {
      xr.requestSession = requestSession;
      (XRSession.prototype as Session).updateRenderState = updateRenderState;
      Object.defineProperty(XRSession.prototype, 'enabledFeatures', features);
      Object.defineProperty(XRSession.prototype, 'frameRate', rate);
      Object.defineProperty(XRView.prototype, 'projectionMatrix', projection);
      Reflect.deleteProperty(globalThis, 'XRGPUBinding');
      texture?.destroy();
      texture = undefined;
    },
  };
}
