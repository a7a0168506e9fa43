import { GaussianSplatError, type ShDegree } from '@gaussian-splat/core';
import { constants } from './generated/shaders.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './pack/words.js';

/** Returns the GPU memory of one splat of a scene in bytes. */
export function bytesPerSplat(shDegree: ShDegree, shPrecision: ShPrecision): number {
  return 4 * (GEOMETRY_WORDS + shWords(shDegree, shPrecision)) + (4 * CHUNK_NUMBERS) / constants.CULL_GROUP;
}

/** GPU memory that one owner has reserved. */
export interface Reservation {
  readonly label: string;
  readonly bytes: number;
  /** Returns the bytes to the ledger; further calls have no effect. */
  release(): void;
}

/**
 * Ledger of the GPU memory of all scenes on a device, and its budget. WebGPU does not report the memory of a GPU.
 * Without a budget every request is granted, until the device itself fails.
 */
export class MemoryLedger {
  /** Upper limit of the bytes of all scenes of the device together. */
  budgetBytes = Infinity;
  /** Upper limit of the bytes of off-screen scenes when other scenes are loaded. */
  unseenBytes = Infinity;
  /**
   * Functions that release memory of little use. The value of each is the bytes that it releases in off-screen scenes,
   * or 0. Functions are called in order until a request fits. Those with off-screen bytes are also called if the sum of
   * these bytes exceeds {@link unseenBytes}.
   */
  readonly releasable = new Map<() => void, number>();
  readonly #held = new Set<Reservation>();

  /** Returns the ledger of a device or WebGL context. All its scenes share one ledger. */
  static of(device: GPUDevice | WebGL2RenderingContext): MemoryLedger {
    const known = LEDGERS.get(device);
    if (known) return known;
    const ledger = new MemoryLedger();
    LEDGERS.set(device, ledger);
    return ledger;
  }

  /** Current reservations by owner. */
  get entries(): readonly Pick<Reservation, 'label' | 'bytes'>[] {
    return [...this.#held].map(({ label, bytes }) => ({ label, bytes }));
  }

  get bytes(): number {
    let sum = 0;
    for (const { bytes } of this.#held) sum += bytes;
    return sum;
  }

  get #unseen(): number {
    return [...this.releasable.values()].reduce((sum, bytes) => sum + bytes, 0);
  }

  /**
   * Reserves bytes before they are allocated, because a device that runs out of memory may be lost, together with the
   * page.
   * @param label Name of the owner, for error messages.
   * @param max Upper limit of this reservation in bytes, besides the rest of the budget; default no limit.
   * @throws GaussianSplatError `out-of-memory/budget` if either limit is exceeded; `argument/value` for a negative
   * number.
   */
  reserve(label: string, bytes: number, max = Infinity): Reservation {
    if (!(bytes >= 0))
      throw new GaussianSplatError('argument/value', {
        where: label,
        expected: 'a number of bytes, 0 or more',
        found: String(bytes),
        remedy: 'pass the number of bytes of the allocation',
      });
    if (bytes > max) throw overBudget(label, bytes, `${inBytes(max)}, the memoryBudget that was given`);
    for (const [giveBack, unseen] of this.releasable) {
      const isScarce = bytes > this.budgetBytes - this.bytes;
      if (isScarce || (unseen && this.#unseen > this.unseenBytes)) giveBack();
    }
    const left = this.budgetBytes - this.bytes;
    if (bytes > left)
      throw overBudget(label, bytes, `${inBytes(Math.max(0, left))} left of a budget of ${inBytes(this.budgetBytes)}`);
    const reservation: Reservation = { label, bytes, release: () => void this.#held.delete(reservation) };
    this.#held.add(reservation);
    return reservation;
  }
}

const LEDGERS = new WeakMap<object, MemoryLedger>();

const inBytes = (value: number): string => `${Math.floor(value)} bytes (${(value / 1e6).toFixed(1)} MB)`;

function overBudget(label: string, bytes: number, max: string): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/budget', {
    where: label,
    expected: `at most ${max}`,
    found: inBytes(bytes),
    remedy: 'show a smaller scene (gaussian-splat optimize makes one), remove others, or raise memoryBudget',
  });
}
