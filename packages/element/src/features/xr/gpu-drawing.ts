import { multiply, type Camera } from '@gaussian-splat/core';
import { GaussianBuffers, Rectangle, Stereo, Viewpoint, World, type FrameSettings } from '@gaussian-splat/renderer';
import { isHandheld } from '../../gpu/memory-budget.js';
import type { WebGpuBackend } from '../../gpu/webgpu-backend.js';
import { packSplats, type SplatRow } from '../../shared/splat-file.js';
import type { GpuImage, GpuTarget } from './gpu-targets.js';
import type { XrFrame, XrView, XrViewport } from './webxr.js';
import type { XrBetween, XrColor, XrDrawing, XrEye, XrMarker } from './xr-drawing.js';
import type { Viewer } from '../../viewer/viewer.js';

/** Maximum number of splats per frame, for scenes with levels of detail in stand-alone headsets. */
const HANDHELD_SPLATS = 400_000;

/** Returns the page's backend if it draws with WebGPU; undefined otherwise, and if its device is lost. */
export function gpuOf({ view: { backend } }: Viewer): WebGpuBackend | undefined {
  return backend && 'viewpoint' in backend && !backend.place.isLost ? (backend as WebGpuBackend) : undefined;
}

/** Draws a session with WebGPU: all scenes of the page, in the buffers of the page's own frames. */
export class GpuDrawing implements XrDrawing {
  readonly isOfPage = true;
  readonly isOpen = true;
  readonly clipDepth: XrDrawing['clipDepth'];
  readonly renderState: object;
  onLost: (what: string) => void = () => undefined;
  readonly #core: Viewer;
  readonly #backend: WebGpuBackend;
  readonly #target: GpuTarget;
  readonly #stereo: Stereo;
  #images = new Map<XrView, GpuImage>();
  #settings: FrameSettings | undefined;
  /** The values of the settings, as text. */
  #settingsKey = '';

  constructor(core: Viewer, backend: WebGpuBackend, target: GpuTarget) {
    this.#core = core;
    this.#backend = backend;
    this.#target = target;
    ({ clipDepth: this.clipDepth, renderState: this.renderState } = target);
    this.#stereo = new Stereo(backend.device);
    // The device outlives the session, and its promise keeps all that waits for it alive.
    const own = new WeakRef(this);
    void backend.place.lost.then(() => own.deref()?.onLost('the GPU device was lost'));
    target.onLost = (what) => this.onLost(what);
  }

  get isLost(): boolean {
    return this.#backend.place.isLost || this.#backend.isDestroyed;
  }

  open(): Promise<void> {
    // The scenes are already loaded, because the page displays them.
    return Promise.resolve();
  }

  begin(frame: XrFrame, views: readonly XrView[], [r, g, b, a]: XrColor): void {
    this.#images = this.#target.begin(frame, views);
    const { device } = this.#backend;
    const encoder = device.createCommandEncoder({ label: 'gs.xr.clear' });
    for (const { texture: view } of this.#images.values())
      encoder
        .beginRenderPass({
          colorAttachments: [{ view, clearValue: { r, g, b, a }, loadOp: 'clear', storeOp: 'store' }],
        })
        .end();
    device.queue.submit([encoder.finish()]);
  }

  viewportOf(view: XrView): XrViewport | null {
    return this.#images.get(view)?.at ?? null;
  }

  draw(eyes: readonly XrEye[], background: XrColor, between: XrBetween, scale: number, now: number): void {
    this.#core.sources.advance(unscaled(eyes[0].camera), now);
    this.#core.view.applyRendering(this.#backend);
    this.#core.prepareFrame();
    const { viewpoint, view } = this.#backend;
    const views = eyes.map((eye) => ({ camera: eye.camera, bounds: eye.at, target: this.#targetOf(eye) }));
    this.#stereo.draw(viewpoint, views, { background, filter: view.filter }, this.#settingsAt(scale));
    for (const eye of eyes) between.drawAbove?.(eye);
    this.#target.end();
  }

  marker(rows: readonly SplatRow[], signal: AbortSignal): XrMarker {
    const { device } = this.#backend;
    let viewpoint: Viewpoint | undefined;
    const load = async (): Promise<void> => {
      const packed = await packSplats(rows, this.#core.services.sceneLoader, signal);
      const scene = await GaussianBuffers.upload(device, packed);
      const free = (): void => {
        viewpoint?.destroy();
        viewpoint = undefined;
        scene.destroy();
      };
      if (signal.aborted) return free();
      signal.addEventListener('abort', free, { once: true });
      const world = new World();
      world.add({ scene });
      viewpoint = new Viewpoint(device, world);
    };
    load().catch(() => undefined);
    return {
      draw: (eye, toWorld) => {
        const camera = { ...eye.room, worldToCamera: multiply(eye.room.worldToCamera, toWorld) };
        const colors = new Rectangle(device, eye.at);
        viewpoint?.draw(camera, { target: this.#targetOf(eye), background: 'load', colors });
      },
    };
  }

  async finished(): Promise<number> {
    await this.#backend.device.queue.onSubmittedWorkDone();
    return performance.now();
  }

  destroy(): void {
    this.onLost = () => undefined;
    this.#stereo.destroy();
    this.#target.destroy();
    this.#images.clear();
    this.#backend.viewpoint.maxSizes = 1;
  }

  #targetOf({ view }: XrEye): { readonly view: GPUTextureView; readonly format: GPUTextureFormat } {
    return { view: this.#images.get(view)!.texture, format: this.#target.format };
  }

  /**
   * Returns the frame settings of the page at a resolution scale, 0..1. Returns the same object while no value changes.
   */
  #settingsAt(resolutionScale: number): FrameSettings {
    const { settings } = this.#backend.view;
    const key = JSON.stringify([settings, resolutionScale]);
    if (this.#settings && key === this.#settingsKey) return this.#settings;
    this.#settingsKey = key;
    // The times of the page's frames say nothing about two eyes at another rate.
    const own = Math.max(
      0,
      ...this.#core.sources.shown.map(({ detail: { splatRange, splatBudget = 0 } }) => splatRange?.[0] ?? splatBudget),
    );
    const budget = own || Infinity;
    const max = isHandheld() ? Math.min(budget, HANDHELD_SPLATS) : budget;
    const splatBudget = Number.isFinite(max) ? max : 0;
    return (this.#settings = { ...settings, resolutionScale, splatBudget });
  }
}

/** Returns the same view in units of the scene. Generators expect a camera without scale. */
function unscaled(camera: Camera): Camera {
  const { worldToCamera: m, near, far } = camera;
  const size = Math.hypot(m[8], m[9], m[10]);
  const worldToCamera = Float64Array.from(m, (value, i) => (i < 12 ? value / size : value));
  return { ...camera, worldToCamera, near: near / size, far: far / size };
}
