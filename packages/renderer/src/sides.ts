import { dot, eyeOf, normalize, subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { GaussianPage, GaussianScene } from './gaussian-scene.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE } from './gpu/kernel.js';
import { GpuMemory, withMemoryCheck } from './gpu/memory.js';
import { MemoryLedger, type Reservation } from './memory-ledger.js';

const { CULL_GROUP, SIDE_WORDS } = constants;
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

/** Directions from a scene's middle that it is looked at from, evenly spread over all of them (a Fibonacci lattice), some 18° from one to the next. */
export const SIDES: readonly Vector3[] = Array.from({ length: constants.SIDES }, (_, k) => {
  const y = 1 - (2 * k + 1) / constants.SIDES;
  const [across, angle] = [Math.sqrt(1 - y * y), k * GOLDEN_ANGLE];
  return [across * Math.cos(angle), y, across * Math.sin(angle)];
});

/** Sides that a picture is drawn from: the nearest, and those around it. */
const NEAR_SIDES = 7;
/** In radii of the scene: a camera nearer to the middle sees what none from outside does. */
const NEAREST = 0.95;
/** Bytes of a splat. */
const BYTES = 4 * SIDE_WORDS;

/** The sphere around a scene that it was looked at from. */
export interface Surroundings {
  readonly center: Vector3;
  readonly radius: number;
}

/** [4] a bit for each of the {@link SIDES} near a camera; none where all splats are to be drawn, for the camera is among them. */
export function sidesNear({ worldToCamera }: Pick<Camera, 'worldToCamera'>, around: Surroundings): Uint32Array {
  const bits = new Uint32Array(SIDE_WORDS);
  const away = subtract(eyeOf(worldToCamera), around.center);
  const distance = Math.hypot(...away);
  if (!(distance >= NEAREST * around.radius)) return bits;
  const direction = normalize(away);
  const likeness = SIDES.map((side) => dot(side, direction));
  const least = [...likeness].sort((a, b) => b - a)[NEAR_SIDES - 1];
  likeness.forEach((value, k) => {
    if (value >= least) bits[k >>> 5] |= 1 << (k & 31);
  });
  return bits;
}

/**
 * A scene with potentially visible sets (Airey 1990): for each splat the {@link SIDES} that it shows from. With the lever `visibleSets` a frame takes the splats alone
 * that show from sides near its camera's. It holds the scene, and frees it.
 */
export class SidedGaussians<
  S extends GaussianScene & { destroy(): void } = GaussianScene & { destroy(): void },
> implements GaussianScene {
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
  static async of<S extends GaussianScene & { destroy(): void }>(
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
  get origin(): Vector3 {
    return this.whole.origin;
  }
  get version(): number {
    return this.whole.version;
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
