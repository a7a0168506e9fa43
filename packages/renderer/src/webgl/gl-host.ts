import { constants } from '../generated/shaders.js';
import { DETAIL_NUMBERS } from '../levels/chunk-detail.js';
import type { PackedGaussians } from '../pack/pack.js';
import type { PageSource } from '../streaming/page-source.js';
import { GlGaussians, type RunGl } from './gl-gaussians.js';
import { firstSplats, GlRenderer, type GlFrameRequest } from './gl-renderer.js';
import { borrowState, setState } from './gl-state.js';
import { GlStream, type GlStreamOptions } from './gl-stream.js';
import { HostDepth, type GlHostFrame } from './host-depth.js';
import { HostedOrder, joinedRows } from './hosted-order.js';
import { HostedSplats } from './hosted-splats.js';

const { CULL_GROUP } = constants;

export interface GlHostOptions {
  /**
   * Worker of the page that sorts, in place of the main thread: it calls `sortSplats` for each message. It may serve any
   * number of scenes. Until its first order the scene is not drawn.
   */
  readonly worker?: Worker;
}

/**
 * Draws splats in the frame of a page that has its own WebGL 2 context, for example a map or an engine. Splats are
 * blended over the host's frame, and hidden by its depth. Each call restores the state of the context.
 *
 * ```ts
 * const host = new GlHost(gl);
 * const splats = await host.load(packGaussians(cloud));
 * // In each frame, after the host has drawn opaque objects:
 * const camera = cameraFromProjection(view, projection, { width, height, clipDepth: '-1..1' });
 * if (!splats.draw(camera, { framebuffer, x, y })) requestFrame();
 * ```
 * `load([a, b])` sorts several scenes together, and `draw([cameraOfA, cameraOfB])` draws them. Splats are hidden with the
 * precision of their stored depth, 0.05 %.
 */
export class GlHost {
  readonly #gl: WebGL2RenderingContext;
  readonly #depth: HostDepth;
  readonly #restores: boolean;

  /**
   * @param options `restores`: whether frames restore the state of the context. Default: true. Set it to false for a host
   * that sets its own state after each call, as MapLibre does after a custom layer: reading the state makes the thread
   * wait for the GPU process.
   */
  constructor(gl: WebGL2RenderingContext, { restores = true }: { readonly restores?: boolean } = {}) {
    this.#gl = gl;
    this.#depth = new HostDepth(gl);
    this.#restores = restores;
  }

  /** Runs calls of the renderer or of WebGL, and then restores the state of the context. */
  readonly run: RunGl = (work) => {
    const giveBack = borrowState(this.#gl);
    try {
      return work();
    } finally {
      giveBack();
    }
  };

  /**
   * Draws the splats of a renderer over the host's frame.
   * @param request Image to draw, with the host's camera: see `cameraFromProjection`, with `clipDepth: '-1..1'`.
   * @param before Called first, with the state that the renderer assumes.
   * @throws GaussianSplatError `argument/value` for a framebuffer whose depth cannot be copied; errors of
   * `GlRenderer.render`.
   */
  draw(renderer: GlRenderer, request: GlFrameRequest, frame: GlHostFrame = {}, before?: () => void): void {
    const run: RunGl = this.#restores ? this.run : (work) => (setState(this.#gl), work());
    run(() => {
      before?.();
      renderer.render(request, this.#depth.quads(request, frame));
      renderer.present(undefined, { ...frame, keeps: true });
    });
  }

  /**
   * Uploads a scene to the GPU, in parts; or several scenes, whose splats are sorted together. Scenes of
   * `packWithDetail` have levels of detail.
   * @throws GaussianSplatError `out-of-memory/*` if memory is insufficient; `unsupported/webgl` if the browser does not
   * compile the shaders.
   */
  async load(
    packed: PackedGaussians | readonly PackedGaussians[],
    { worker }: GlHostOptions = {},
  ): Promise<HostedSplats> {
    const all = [packed].flat();
    const counts = all.map(({ count }) => count);
    const gaussians: GlGaussians[] = [];
    try {
      for (const scene of all) gaussians.push(await GlGaussians.upload(this.#gl, scene, this.run));
      await this.run(() => GlRenderer.prepare(this.#gl));
      const renderer = this.run(() => new GlRenderer(this.#gl, ...gaussians));
      const { first, count } = firstSplats(this.#gl, counts);
      const order = new HostedOrder(joinedRows(all, first, count), worker);
      const scenes = gaussians.map((own, k) => ({
        gaussians: own,
        first: first[k],
        hasLevels: all[k].details !== undefined,
      }));
      return new HostedSplats(this, renderer, scenes, { order });
    } catch (error) {
      for (const own of gaussians) own.destroy();
      throw error;
    }
  }

  /**
   * Opens a scene of any size, and fetches its coarsest page. Frames then request the pages that they need.
   * @param source Pages: see `openPages` of `@gaussian-splat/element/pages.js`.
   * @throws GaussianSplatError `out-of-memory/*` if memory or `maxSplats` is insufficient; `unsupported/webgl` if the
   * browser does not compile the shaders; errors of the source for the first page; the reason of `signal`.
   */
  async stream(
    source: PageSource,
    { worker, ...options }: GlHostOptions & GlStreamOptions = {},
  ): Promise<HostedSplats> {
    await this.run(() => GlRenderer.prepare(this.#gl));
    const stream = await GlStream.open(this.#gl, source, options, this.run);
    try {
      const { gaussians, count } = stream;
      const renderer = this.run(() => new GlRenderer(this.#gl, gaussians));
      const positions = new Float32Array(3 * count).fill(NaN);
      const details = new Float32Array(DETAIL_NUMBERS * (count / CULL_GROUP));
      const order = new HostedOrder({ positions, details }, worker, stream);
      return new HostedSplats(this, renderer, [{ gaussians, first: 0, hasLevels: true }], { order, stream });
    } catch (error) {
      stream.destroy();
      throw error;
    }
  }

  /** Frees the GPU memory of the host, without that of scenes. */
  destroy(): void {
    this.#depth.destroy();
  }
}
