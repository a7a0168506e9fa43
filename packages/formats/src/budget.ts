import { GaussianSplatError, shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/** What one load may cost at most. What is left out is not limited, beyond what the file's own bytes allow: see SECURITY.md. */
export interface LoadLimits {
  /** Splats that are read, those of all levels of detail together. */
  readonly maxSplats?: number;
  /** Bytes of memory: those that arrive, and those that are allocated for what they unpack to. */
  readonly maxBytes?: number;
  /** Seconds from the beginning of the load to its end, the download included. */
  readonly maxSeconds?: number;
}

/** Bytes that every load may take, whatever arrives; */
const FREE_BYTES = 2 ** 26;
/** and for each byte that has arrived. Real scenes need 1 to 100: a splat of SOG has 3 bytes or more, and takes up to 500 on its way. */
const BYTES_PER_BYTE = 256;

/**
 * What one load has taken, and may take. All that a file can name more than once, or announce, is charged here before it is allocated, all of it to the same account:
 * nothing is given back, so that work is bounded as memory is. Loops that allocate nothing charge their steps as bytes.
 */
export class LoadBudget {
  readonly #limits: LoadLimits;
  readonly #start = performance.now();
  #arrived: number;
  #taken = 0;

  /** @param arrived bytes of the scene's own file */
  constructor(arrived: number, limits: LoadLimits = {}) {
    this.#arrived = arrived;
    this.#limits = limits;
  }

  /** Bytes of all files that have arrived. */
  get arrived(): number {
    return this.#arrived;
  }

  /** Bytes that have been charged. */
  get taken(): number {
    return this.#taken;
  }

  /** Bytes that may be charged in all. */
  get allowed(): number {
    const left = (this.#limits.maxBytes ?? Infinity) - this.#arrived;
    return Math.max(0, Math.min(FREE_BYTES + BYTES_PER_BYTE * this.#arrived, left));
  }

  /** Another file of the scene has arrived, which allows for more. */
  arrive(bytes: number): void {
    this.#arrived += bytes;
  }

  /**
   * Charges bytes that are about to be allocated.
   * @param where what error messages call the file
   * @throws GaussianSplatError `out-of-memory/budget`
   */
  take(bytes: number, where: string): void {
    this.#taken += bytes;
    const { allowed } = this;
    if (this.#taken > allowed)
      refuse(
        where,
        `at most ${grouped(allowed)} bytes of memory for ${grouped(this.#arrived)} that arrived`,
        `${grouped(this.#taken)} or more`,
      );
    const { maxSeconds = Infinity } = this.#limits;
    if (performance.now() - this.#start > 1000 * maxSeconds) refuse(where, `at most ${maxSeconds} s`, 'more');
  }

  /** Charges the arrays of a cloud. Throws as {@link take} does. */
  takeSplats(count: number, degree: ShDegree, where: string): void {
    const { maxSplats = Infinity } = this.#limits;
    if (count > maxSplats) refuse(where, `at most ${grouped(maxSplats)} splats`, grouped(count));
    this.take(4 * count * (11 + 3 * shCoefficientCount(degree)), where);
  }
}

/** Throws the error for what is over a limit. */
export function refuse(where: string, expected: string, found: string, cause?: unknown): never {
  throw new GaussianSplatError('out-of-memory/budget', {
    where,
    expected,
    found,
    remedy: 'use a smaller scene, or allow for more',
    cause,
  });
}
