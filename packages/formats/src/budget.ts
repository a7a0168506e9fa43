import { GaussianSplatError, shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/** Upper limits of one load. Missing limits default to the bound by the file's own bytes: see SECURITY.md. */
export interface LoadLimits {
  /** Maximum number of splats, over all levels of detail. */
  readonly maxSplats?: number;
  /** Maximum bytes of memory: downloaded bytes, plus allocations for unpacking them. */
  readonly maxBytes?: number;
  /** Seconds from the beginning of the load to its end, including the download. */
  readonly maxSeconds?: number;
}

/** Bytes that every load may allocate, independent of its size, */
const FREE_BYTES = 2 ** 26;
/**
 * plus this number for each downloaded byte. Real scenes need 1 to 100: a splat of SOG has 3 bytes or more, and takes
 * up to 500 during decoding.
 */
const BYTES_PER_BYTE = 256;

/**
 * Account of one load and its limits. Everything that a file can repeat or declare is charged to it before it is
 * allocated. Nothing is refunded, which bounds work as well as memory. Loops without allocations charge their steps as
 * bytes.
 */
export class LoadBudget {
  readonly #limits: LoadLimits;
  readonly #start = performance.now();
  #arrived: number;
  #taken = 0;

  /** @param arrived Bytes of the scene's own file. */
  constructor(arrived: number, limits: LoadLimits = {}) {
    this.#arrived = arrived;
    this.#limits = limits;
  }

  /** Downloaded bytes over all files. */
  get arrived(): number {
    return this.#arrived;
  }

  /** Charged bytes. */
  get taken(): number {
    return this.#taken;
  }

  /** Maximum total of charged bytes. */
  get allowed(): number {
    const left = (this.#limits.maxBytes ?? Infinity) - this.#arrived;
    return Math.max(0, Math.min(FREE_BYTES + BYTES_PER_BYTE * this.#arrived, left));
  }

  /** Adds another file of the scene, which raises the limit. */
  arrive(bytes: number): void {
    this.#arrived += bytes;
  }

  /**
   * Charges bytes before they are allocated.
   * @param where Name of the file in error messages.
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

/** Throws the error for an exceeded limit. */
export function refuse(where: string, expected: string, found: string, cause?: unknown): never {
  throw new GaussianSplatError('out-of-memory/budget', {
    where,
    expected,
    found,
    remedy: 'use a smaller scene, or allow for more',
    cause,
  });
}
