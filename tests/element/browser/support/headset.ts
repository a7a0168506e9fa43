/** An emulated headset, with what real ones have and the emulator lacks: a framebuffer of the layer's own, and off-center eyes. */
import { metaQuest3, XRDevice } from 'iwer';

export const EYE = { width: 160, height: 168 };
/** Degrees to the left, right, up and down. */
const ANGLES: Record<string, number[]> = { left: [52, 42, 46, 50], right: [42, 52, 46, 50], none: [40, 40, 40, 40] };

interface Layer {
  readonly context: WebGL2RenderingContext;
}

export interface Headset {
  readonly device: XRDevice;
  /** Eyes of the last layer. */
  layer: Layer | undefined;
  /** Bytes of an eye in the last layer, from its upper row on. */
  pixels(eye: 'left' | 'right'): Uint8Array;
  projection(eye: string): Float32Array;
}

interface Patched {
  prototype: Record<string, unknown>;
}

let only: Headset | undefined;

/** The page's headset: one for all tests of a page. */
export function headset(): Headset {
  if (only) return only;
  const device = new XRDevice(metaQuest3);
  device.installRuntime({ forceInstall: true } as never);
  const { XRWebGLLayer, XRView } = globalThis as unknown as Record<string, Patched>;
  const made = new WeakMap<object, WebGLFramebuffer>();
  const projection = (eye: string): Float32Array => {
    const [l, r, u, d] = ANGLES[eye].map((angle) => Math.tan((angle * Math.PI) / 180));
    const [n, f] = [0.05, 1000];
    return Float32Array.of(
      ...[2 / (l + r), 0, 0, 0, 0, 2 / (u + d), 0, 0],
      ...[(r - l) / (r + l), (u - d) / (u + d), -(f + n) / (f - n), -1, 0, 0, (-2 * f * n) / (f - n), 0],
    );
  };
  const framebufferOf = (layer: Layer): WebGLFramebuffer => {
    only!.layer = layer;
    const known = made.get(layer);
    if (known) return known;
    const gl = layer.context;
    const color = gl.createRenderbuffer();
    const framebuffer = gl.createFramebuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, color);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, 2 * EYE.width, EYE.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, color);
    made.set(layer, framebuffer);
    return framebuffer;
  };
  const give = (type: Patched, name: string, get: (this: never) => unknown): void =>
    void Object.defineProperty(type.prototype, name, { configurable: true, get });
  give(XRWebGLLayer, 'framebuffer', function (this: Layer) {
    return framebufferOf(this);
  });
  give(XRWebGLLayer, 'framebufferWidth', () => 2 * EYE.width);
  give(XRWebGLLayer, 'framebufferHeight', () => EYE.height);
  XRWebGLLayer.prototype.getViewport = ({ eye }: { eye: string }) => ({
    ...{ x: eye === 'right' ? EYE.width : 0, y: 0 },
    ...EYE,
  });
  give(XRView, 'projectionMatrix', function (this: { eye: string }) {
    return projection(this.eye);
  });
  // The emulator reads this of lost contexts, too, which have null.
  const { getParameter } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return (getParameter.call(this, name) as unknown) ?? (name === this.COLOR_CLEAR_VALUE ? [0, 0, 0, 0] : null);
  };
  only = {
    ...{ device, layer: undefined, projection },
    pixels(eye) {
      const layer = only!.layer!;
      const gl = layer.context;
      gl.bindFramebuffer(gl.FRAMEBUFFER, framebufferOf(layer));
      const { width, height } = EYE;
      const bytes = new Uint8Array(4 * width * height);
      gl.readPixels(eye === 'right' ? width : 0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      const row = 4 * width;
      return bytes.map((_, i) => bytes[row * (height - 1 - Math.floor(i / row)) + (i % row)]);
    },
  };
  return only;
}
