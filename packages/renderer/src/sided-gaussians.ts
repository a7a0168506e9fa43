import type { Vector3 } from '@gaussian-splat/core';
import type { GaussianPage, GaussianScene } from './gaussian-scene.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { MemoryLedger, type Reservation } from './memory-ledger.js';
import type { Surroundings } from './sides.js';

const { CULL_GROUP, SIDE_WORDS } = constants;
/** Bytes of a splat. */
const BYTES = 4 * SIDE_WORDS;

/** A scene whose GPU memory somebody holds. */
export interface HeldScene extends GaussianScene {
  readonly byteLength: number;
  readonly droppedCount?: number;
  destroy(): void;
}

/**
 * A scene with potentially visible sets (Airey 1990): for each splat the `SIDES` that it shows from. With the lever `visibleSets` a frame takes the splats alone
 * that show from sides near its camera's. It holds the scene, and frees it.
 */
export class SidedGaussians<S extends HeldScene = HeldScene> implements GaussianScene {
  /** The scene itself. */
  readonly whole: S;
  readonly around: Surroundings;
  readonly pages: readonly (GaussianPage & Required<Pick<GaussianPage, 'seenFrom'>>)[];
  readonly #memory: GpuMemory;
  readonly #reservation: Reservation;

  private constructor(device: GPUDevice, whole: S, around: Surroundings, reservation: Reservation) {
    this.whole = whole;
    this.around = around;
    this.#reservation = reservation;
    this.#memory = new GpuMemory(device);
    const usage = BUFFER_USAGE.storage | BUFFER_USAGE.copySource;
    try {
      this.pages = whole.pages.map((page) => ({
        ...page,
        seenFrom: this.#memory.buffer('gs.gaussians.seen_from', bytesOf(page), usage),
      }));
    } catch (error) {
      this.release();
      throw error;
    }
  }

  /**
   * Makes room for the sets of a scene: so far none of its splats shows from anywhere. `lookAround` of @gaussian-splat/economise fills them in.
   * @param memoryBudget bytes that the sets may take; default no limit
   * @throws GaussianSplatError `out-of-memory/budget` or `out-of-memory/allocation`
   */
  static async of<S extends HeldScene>(
    device: GPUDevice,
    whole: S,
    around: Surroundings,
    memoryBudget?: number,
  ): Promise<SidedGaussians<S>> {
    const what = `visible sets of ${whole.count} splats`;
    const bytes = whole.pages.reduce((sum, page) => sum + bytesOf(page), 0);
    const reservation = MemoryLedger.of(device).reserve(what, bytes, memoryBudget);
    const made = await withMemoryCheck(device, what, () => {
      const sided = new SidedGaussians(device, whole, around, reservation);
      return { sided, destroy: () => sided.release() };
    });
    return made.sided;
  }

  get count(): number {
    return this.whole.count;
  }
  get shDegree(): S['shDegree'] {
    return this.whole.shDegree;
  }
  get shPrecision(): S['shPrecision'] {
    return this.whole.shPrecision;
  }
  get antialiased(): boolean {
    return this.whole.antialiased;
  }

  get filterVariance(): number | undefined {
    return this.whole.filterVariance;
  }
  get origin(): Vector3 {
    return this.whole.origin;
  }
  get version(): number {
    return this.whole.version;
  }

  /** Splats of the source that were left out, if the scene says so. */
  get droppedCount(): number | undefined {
    return this.whole.droppedCount;
  }

  /** Bytes of GPU memory held, by the scene and by its sets. */
  get byteLength(): number {
    return this.whole.byteLength + this.setBytes;
  }

  /** Bytes of GPU memory that the sets take, the scene itself not counted. */
  get setBytes(): number {
    return this.#memory.byteLength;
  }

  /** Frees the sets, and leaves the scene alone. */
  release(): void {
    this.#reservation.release();
    this.#memory.destroy();
  }

  /** Frees the sets and the scene. */
  destroy(): void {
    this.release();
    this.whole.destroy();
  }
}

/** Rows are as long as whole chunks are. */
const bytesOf = ({ count }: GaussianPage): number => BYTES * CULL_GROUP * Math.ceil(count / CULL_GROUP);
