import { drawn } from '@gaussian-splat/renderer/webgl';
import type { SplatRow } from '../../shared/splat-file.js';
import type { Viewer } from '../../viewer/viewer.js';
import { MarkerSplats } from './marker-splats.js';
import { ViewOrder } from './view-order.js';
import { makeLayer, type XrLayer, type XrSession, type XrView, type XrViewport } from './webxr.js';
import type { XrBetween, XrColor, XrDrawing, XrEye, XrMarker } from './xr-drawing.js';
import {
  contextFor,
  openXrScene,
  unsupported,
  type XrContext,
  type XrScene,
  type XrSceneSource,
  type XrShown,
} from './xr-scene.js';

/** Draws a session with WebGL 2: the page's own splats, or the same file again in a context of the session. */
export class GlDrawing implements XrDrawing {
  readonly clipDepth = '-1..1';
  readonly renderState: { readonly baseLayer: XrLayer };
  readonly isOfPage: boolean;
  readonly gl: WebGL2RenderingContext;
  onLost: (what: string) => void = () => undefined;
  readonly #context: XrContext;
  readonly #layer: XrLayer;
  readonly #source: XrSceneSource;
  readonly #core: Viewer;
  readonly #over = new AbortController();
  #scene: XrScene | undefined;
  #order: ViewOrder | undefined;

  constructor(session: XrSession, context: XrContext, source: XrSceneSource, core: Viewer) {
    this.#context = context;
    this.#source = source;
    this.#core = core;
    this.gl = context.gl;
    this.isOfPage = !context.isOwn;
    this.#layer = makeLayer(session, context.gl);
    this.renderState = { baseLayer: this.#layer };
    const { signal } = this.#over;
    this.gl.canvas.addEventListener('webglcontextlost', () => this.onLost('the WebGL context was lost'), { signal });
  }

  /** Opens a context for the scene that the element displays. */
  static async open(session: XrSession, core: Viewer, { shown, request }: XrShown): Promise<GlDrawing> {
    if (request === null) throw unsupported('a scene that has loaded', 'none');
    const { sceneLoader: loader } = core.services;
    return new GlDrawing(session, await contextFor(shown), { shown, request, loader }, core);
  }

  get isLost(): boolean {
    return this.gl.isContextLost();
  }

  get isOpen(): boolean {
    return this.#scene !== undefined;
  }

  /** The drawn scene; undefined until it is loaded. */
  get scene(): XrScene | undefined {
    return this.#scene;
  }

  async open(signal: AbortSignal): Promise<void> {
    const scene = await openXrScene(this.#context, this.#source, signal);
    if (this.#over.signal.aborted) return scene.destroy();
    this.#scene = scene;
    this.#sort(scene.positions);
  }

  /** Restricts drawing to splats whose position is not NaN. @param positions [N, 3] relative to the scene's origin */
  crop(positions: Float32Array): void {
    this.#order?.destroy();
    this.#sort(positions);
  }

  begin(_frame: unknown, _views: unknown, color: XrColor): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.#layer.framebuffer);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearBufferfv(gl.COLOR, 0, color);
  }

  viewportOf(view: XrView): XrViewport | null {
    return this.#layer.getViewport(view);
  }

  draw(eyes: readonly XrEye[], background: XrColor, between: XrBetween, scale: number): void {
    if (!this.#scene) return;
    const { renderer } = this.#scene;
    const { maxShDegree: shDegree, filter: choice, order } = this.#core.attributes;
    const filter = choice === 'auto' ? undefined : choice;
    this.#order?.update(
      eyes.map(({ camera }) => camera),
      order === 'distance',
    );
    for (const eye of eyes) {
      const at = this.#rectangleOf(eye);
      between.drawBelow?.(eye);
      renderer.render({ camera: eye.camera, shDegree, filter, accumulation: 'rgba16float', resolutionScale: scale });
      if (between.drawBelow) renderer.present(undefined, { ...at, keeps: true });
      else renderer.present(background, at);
      between.drawAbove?.(eye);
    }
  }

  marker(rows: readonly SplatRow[], signal: AbortSignal): XrMarker {
    const splats = new MarkerSplats(this.gl, rows, this.#source.loader, signal);
    return { draw: (eye, toWorld) => splats.draw(eye.room, this.#rectangleOf(eye), toWorld) };
  }

  async finished(): Promise<number> {
    return (await drawn(this.gl)).now;
  }

  destroy(): void {
    this.#over.abort();
    this.#order?.destroy();
    this.#scene?.destroy();
    this.#scene = undefined;
    if (this.#context.isOwn) this.gl.getExtension('WEBGL_lose_context')?.loseContext();
  }

  #rectangleOf({ at: { x, y } }: XrEye): { framebuffer: WebGLFramebuffer | null; x: number; y: number } {
    return { framebuffer: this.#layer.framebuffer, x, y };
  }

  #sort(positions: Float32Array): void {
    this.#order = new ViewOrder({ ...this.#scene!, positions }, this.#source.loader.spawn);
  }
}
