import { GaussianSplatError, type ShDegree } from '@gaussian-splat/core';
import { constants } from './generated/shaders.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, type ShPrecision, shWords } from './pack/words.js';

/** GPU memory that one splat of a scene takes, in bytes, before a single one is uploaded. */
export function bytesPerSplat(shDegree: ShDegree, shPrecision: ShPrecision): number {
  return 4 * (GEOMETRY_WORDS + shWords(shDegree, shPrecision)) + (4 * CHUNK_NUMBERS) / constants.CULL_GROUP;
}

/** Bytes that one owner holds; given back once. */
export interface Reservation {
  readonly label: string;
  readonly bytes: number;
  release(): void;
}

/**
 * What the scenes on a device hold, and how much they may. WebGPU does not tell how much memory a GPU has: without a budget everything
 * is let through, and the device itself refuses.
 */
export class MemoryLedger {
  /** Most bytes that all scenes of the device together may hold. */
  budgetBytes = Infinity;
  /** Bytes that scenes out of sight may hold while others are loaded. */
  unseenBytes = Infinity;
  /**
   * Functions that give back what will soon not be needed any more, called one after the other if there is no room for a request; with the bytes of those
   * that are out of sight, which are called if these hold more than {@link unseenBytes}, too.
   */
  readonly spare = new Map<() => void, number>();
  readonly #held = new Set<Reservation>();

  /** The ledger of a device, or of a context of WebGL; all scenes on it share one. */
  static of(device: GPUDevice | WebGL2RenderingContext): MemoryLedger {
    const known = LEDGERS.get(device);
    if (known) return known;
    const ledger = new MemoryLedger();
    LEDGERS.set(device, ledger);
    return ledger;
  }

  /** What is held, by owner. */
  get entries(): readonly Pick<Reservation, 'label' | 'bytes'>[] {
    return [...this.#held].map(({ label, bytes }) => ({ label, bytes }));
  }

  get bytes(): number {
    let sum = 0;
    for (const { bytes } of this.#held) sum += bytes;
    return sum;
  }

  get #unseen(): number {
    return [...this.spare.values()].reduce((sum, bytes) => sum + bytes, 0);
  }

  /**
   * Sets bytes aside before they are allocated: a device that runs out of memory may be lost, and the page with it.
   * @param most bytes that this reservation may take, besides what is left; default no limit
   * @throws GaussianSplatError `out-of-memory/budget` if it is more than that, or more than the budget leaves.
   */
  reserve(label: string, bytes: number, most = Infinity): Reservation {
    if (!(bytes >= 0))
      throw new GaussianSplatError('argument/value', {
        where: label,
        expected: 'a number of bytes, 0 or more',
        found: String(bytes),
        remedy: 'hand over the bytes that will be allocated',
      });
    if (bytes > most) throw overBudget(label, bytes, `${inBytes(most)}, the memoryBudget that was given`);
    for (const [giveBack, unseen] of this.spare) {
      const isScarce = bytes > this.budgetBytes - this.bytes;
      if (isScarce || (unseen && this.#unseen > this.unseenBytes)) giveBack();
    }
    const left = this.budgetBytes - this.bytes;
    if (bytes > left)
      throw overBudget(
        label,
        bytes,
        `${inBytes(Math.max(0, left))}, what is left of a budget of ${inBytes(this.budgetBytes)}`,
      );
    const reservation: Reservation = { label, bytes, release: () => void this.#held.delete(reservation) };
    this.#held.add(reservation);
    return reservation;
  }
}

const LEDGERS = new WeakMap<object, MemoryLedger>();

const inBytes = (value: number): string => `${Math.floor(value)} bytes (${(value / 1e6).toFixed(1)} MB)`;

function overBudget(label: string, bytes: number, most: string): GaussianSplatError {
  return new GaussianSplatError('out-of-memory/budget', {
    where: label,
    expected: `at most ${most}`,
    found: inBytes(bytes),
    remedy:
      'show a smaller scene (gaussian-splat economise makes one), remove others, or raise the budget (memoryBudget)',
  });
}
