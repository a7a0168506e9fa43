import { glBytes, GlGaussians, GlRenderer } from '@gaussian-splat/renderer/webgl';
import { LoadedGaussians, type OwnedGaussians } from '../gpu/loaded-gaussians.js';
import { defaultMemoryBudget } from '../gpu/memory-budget.js';
import type { Contents, Painter, PainterEvents } from '../gpu/painter.js';
import type { LoadedScene } from '../loading/protocol.js';
import { GlPainter } from './gl-painter.js';
import type { GlLease } from './gl-session.js';

/** 32-bit words of a splat's geometry; the first three are its position. */
const GEOMETRY_WORDS = 8;

export interface GlUploadOptions {
  readonly signal: AbortSignal;
  readonly memoryBudget: number | undefined;
  readonly spawn: () => Worker;
}

/** A scene in textures: it is drawn alone, without levels of detail. */
export class GlLoaded extends LoadedGaussians {
  override readonly renderer = 'webgl';
  readonly lease: GlLease;
  readonly frames: GlRenderer;
  /** [N, 3] relative to the scene's origin */
  readonly positions: Float32Array;
  readonly spawn: () => Worker;

  private constructor(
    lease: GlLease,
    frames: GlRenderer,
    gaussians: OwnedGaussians,
    { packed, bounds, pixelShare = 1, warnings = [], hasMeshes = false }: LoadedScene,
    spawn: () => Worker,
  ) {
    super(lease, gaussians, bounds, 1, { warnings: hasMeshes ? [...warnings, NO_MESHES] : warnings });
    this.pixelShare = pixelShare;
    this.lease = lease;
    this.frames = frames;
    this.spawn = spawn;
    this.positions = positionsIn(packed.geometry);
  }

  /** Puts a scene on the GPU, which then owns the lease. Rejects with GaussianSplatError `out-of-memory/*` or the signal's reason. */
  static async open(lease: GlLease, scene: LoadedScene, options: GlUploadOptions): Promise<GlLoaded> {
    const { signal, memoryBudget, spawn } = options;
    const { packed } = scene;
    const byteLength = glBytes(packed);
    const ledger = lease.memory;
    ledger.budgetBytes = Math.max(memoryBudget ?? 0, defaultMemoryBudget() ?? Infinity);
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
      signal.throwIfAborted();
      frames = new GlRenderer(lease.gl, textures);
      const gaussians = { ...textures.facts, pages: [], version: 0, byteLength, destroy };
      return new GlLoaded(lease, frames, gaussians, scene, spawn);
    } catch (error) {
      destroy();
      throw error;
    }
  }

  override openPainter(_: Contents, events: PainterEvents): Painter {
    return new GlPainter(this, events);
  }

  /** None are built. */
  override get hasOwnLevels(): boolean {
    return true;
  }

  override setDetail(): void {}
}

const NO_MESHES = 'the triangles of the file are not shown: this page draws with WebGL 2, which shows splats alone';

function positionsIn(geometry: Uint32Array): Float32Array {
  const numbers = new Float32Array(geometry.buffer, geometry.byteOffset, geometry.length);
  const positions = new Float32Array((3 * geometry.length) / GEOMETRY_WORDS);
  for (let at = 0, from = 0; at < positions.length; at += 3, from += GEOMETRY_WORDS) {
    positions[at] = numbers[from];
    positions[at + 1] = numbers[from + 1];
    positions[at + 2] = numbers[from + 2];
  }
  return positions;
}
