import { areasIn, glBytes, GlGaussians, GlRenderer, positionsIn } from '@gaussian-splat/renderer/webgl';
import { LoadedGaussians, type OwnedGaussians } from '../gpu/loaded-gaussians.js';
import { limit } from '../gpu/memory-budget.js';
import type { FrameSource, Backend, BackendEvents } from '../gpu/backend.js';
import type { LoadedScene } from '../loading/protocol.js';
import { WebGlBackend } from './webgl-backend.js';
import type { GlLease } from './gl-session.js';

export interface GlUploadOptions {
  readonly signal: AbortSignal;
  readonly memoryBudget: number | undefined;
  readonly spawn: () => Worker;
}

/** A scene in WebGL textures. It is drawn alone, without levels of detail. */
export class GlLoaded extends LoadedGaussians {
  override readonly renderer = 'webgl';
  override readonly can = WebGlBackend.can;
  readonly lease: GlLease;
  readonly frames: GlRenderer;
  readonly textures: GlGaussians;
  /** [N, 3] positions relative to the scene's origin. */
  readonly positions: Float32Array;
  /** [N] area of each splat's largest cross-section. */
  readonly areas: Float32Array;
  readonly spawn: () => Worker;

  private constructor(
    lease: GlLease,
    frames: GlRenderer,
    textures: GlGaussians,
    gaussians: OwnedGaussians,
    { packed, bounds, warnings = [], hasMeshes = false }: LoadedScene,
    areas: Float32Array,
    spawn: () => Worker,
  ) {
    super(lease, gaussians, bounds, 1, { warnings: hasMeshes ? [...warnings, NO_MESHES] : warnings });
    this.lease = lease;
    this.frames = frames;
    this.textures = textures;
    this.spawn = spawn;
    this.positions = positionsIn(packed.geometry);
    this.areas = areas;
  }

  /**
   * Uploads a scene. The result owns the lease and releases it when it is destroyed. Rejects with GaussianSplatError
   * `out-of-memory/*`, or the signal's reason.
   */
  static async open(lease: GlLease, scene: LoadedScene, options: GlUploadOptions): Promise<GlLoaded> {
    const { signal, memoryBudget, spawn } = options;
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
      return new GlLoaded(lease, frames, textures, gaussians, scene, areas, spawn);
    } catch (error) {
      destroy();
      throw error;
    }
  }

  override openBackend(_: FrameSource, events: BackendEvents): Backend {
    return new WebGlBackend(this, events);
  }
}

const NO_MESHES = 'the triangles of the file are not shown: this page draws with WebGL 2, which shows splats alone';
