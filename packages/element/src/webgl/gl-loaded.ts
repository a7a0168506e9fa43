import { areasIn, glBytes, GlGaussians, GlRenderer, positionsIn } from '@gaussian-splat/renderer/webgl';
import { LoadedGaussians, type OwnedGaussians } from '../gpu/loaded-gaussians.js';
import { limit } from '../gpu/memory-budget.js';
import type { FrameSource, Backend, BackendEvents } from '../gpu/backend.js';
import type { Timeline } from '../sources/generator/dynamic-model.js';
import type { LoadedScene } from '../loading/protocol.js';
import { WebGlBackend } from './webgl-backend.js';
import type { GlLease } from './gl-session.js';

export interface GlUploadOptions {
  readonly signal: AbortSignal;
  readonly memoryBudget: number | undefined;
  readonly spawn: () => Worker;
}

/** The splats of a scene in WebGL textures. */
interface GlContent {
  readonly gaussians: OwnedGaussians;
  readonly frames: GlRenderer;
  readonly textures: GlGaussians;
  /** [N, 3] positions relative to the scene's origin. */
  readonly positions: Float32Array;
  /** [N] area of each splat's largest cross-section. */
  readonly areas: Float32Array;
}

/** A scene in WebGL textures. It is drawn alone, without levels of detail. */
export class GlLoaded extends LoadedGaussians {
  override readonly renderer = 'webgl';
  override readonly can = WebGlBackend.can;
  readonly lease: GlLease;
  override readonly live: Timeline | undefined;
  #content: GlContent;
  readonly spawn: () => Worker;

  private constructor(
    lease: GlLease,
    content: GlContent,
    { bounds, warnings = [], hasMeshes = false, credits, groups }: LoadedScene,
    spawn: () => Worker,
    live: Timeline | undefined,
  ) {
    const all = hasMeshes ? [...warnings, NO_MESHES] : warnings;
    super(lease, content.gaussians, bounds, 1, { warnings: all, credits, groups });
    this.lease = lease;
    this.#content = content;
    this.spawn = spawn;
    this.live = live;
  }

  /**
   * Uploads a scene. The result owns the lease and releases it when it is destroyed. Rejects with GaussianSplatError
   * `out-of-memory/*`, or the signal's reason.
   * @param live The object that replaces the content; undefined for a file.
   */
  static async open(lease: GlLease, scene: LoadedScene, options: GlUploadOptions, live?: Timeline): Promise<GlLoaded> {
    return new GlLoaded(lease, await GlLoaded.contentOf(lease, scene, options), scene, options.spawn, live);
  }

  /** Uploads the content of a scene. Rejects as {@link open} does. */
  static async contentOf(lease: GlLease, scene: LoadedScene, options: GlUploadOptions): Promise<GlContent> {
    const { signal, memoryBudget } = options;
    const { packed } = scene;
    const byteLength = glBytes(packed);
    const ledger = lease.memory;
    limit(ledger, memoryBudget);
    const reservation = ledger.reserve(`scene of ${packed.count} splats`, byteLength, memoryBudget);
    let textures: GlGaussians | undefined;
    let frames: GlRenderer | undefined;
    const destroy = (): void => {
      frames?.destroy();
      textures?.destroy();
      reservation.release();
    };
    try {
      textures = await GlGaussians.upload(lease.gl, packed);
      await GlRenderer.prepare(lease.gl);
      const areas = await areasIn(packed.geometry);
      signal.throwIfAborted();
      frames = new GlRenderer(lease.gl, textures);
      const gaussians = { ...textures.facts, blocks: [], version: 0, byteLength, destroy };
      return { gaussians, frames, textures, positions: positionsIn(packed.geometry), areas };
    } catch (error) {
      destroy();
      throw error;
    }
  }

  get content(): GlContent {
    return this.#content;
  }

  get frames(): GlRenderer {
    return this.#content.frames;
  }

  get textures(): GlGaussians {
    return this.#content.textures;
  }

  /** Shows other content in subsequent frames, and frees that of before. */
  replace(content: GlContent): void {
    this.replaceGaussians(content.gaussians);
    this.#content = content;
  }

  override openBackend(_: FrameSource, events: BackendEvents): Backend {
    return new WebGlBackend(this, events);
  }
}

const NO_MESHES = 'the triangles of the file are not shown: this page draws with WebGL 2, which shows splats alone';
