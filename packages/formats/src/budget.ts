import { GaussianSplatError, shCoefficientCount, type ShDegree } from '@gaussian-splat/core';
import { grouped } from './bytes.js';

/**
 * Upper limits of one load. Without `maxBytes`, only the downloaded bytes bound the memory; SECURITY.md describes this
 * bound. Without `maxSplats` or `maxSeconds`, there is no limit of that kind.
 */
export interface LoadLimits {
  /** Maximum number of splats, over all levels of detail. */
  readonly maxSplats?: number;
  /** Maximum bytes of memory: downloaded bytes, plus allocations for unpacking them. */
  readonly maxBytes?: number;
  /** Seconds from the beginning of the load to its end, including the download. */
  readonly maxSeconds?: number;
}

/** Bytes that every load may allocate in addition to {@link BYTES_PER_BYTE} for each downloaded byte. */
const FREE_BYTES = 2 ** 26;
/**
 * Bytes that a load may allocate for each downloaded byte. Real scenes need 1 to 100: a splat of SOG has 3 bytes or
 * more in its file, and takes up to 500 bytes during decoding.
 */
const BYTES_PER_BYTE = 256;
/** Requests that every load may make in addition to one for each downloaded KiB. */
const FREE_REQUESTS = 1000;

/**
 * Account of the bytes and requests of one load, with its limits. Readers charge each allocation before they make it, if
 * its size depends on the file. Charges are never refunded, so that they bound work as well as memory. Loops without
 * allocations charge each step as a byte.
 */
export class LoadBudget {
  readonly #limits: LoadLimits;
  readonly #start = performance.now();
  #arrived: number;
  #taken = 0;
  /** Number of requests; the first is that of the scene's own file. */
  #requests = 1;

  /** @param arrived Size of the scene's own file in bytes. */
  constructor(arrived: number, limits: LoadLimits = {}) {
    this.#arrived = arrived;
    this.#limits = limits;
  }

  /** Number of downloaded bytes, of all files of the scene. */
  get arrived(): number {
    return this.#arrived;
  }

  /** Number of bytes that have been charged. */
  get taken(): number {
    return this.#taken;
  }

  /** Maximum of {@link taken}, in bytes. It grows with {@link arrived}. */
  get allowed(): number {
    const left = (this.#limits.maxBytes ?? Infinity) - this.#arrived;
    return Math.max(0, Math.min(FREE_BYTES + BYTES_PER_BYTE * this.#arrived, left));
  }

  /**
   * Charges a request for another file of the scene, before it is made.
   * @param where Name of the file in error messages.
   * @throws GaussianSplatError `out-of-memory/budget` for more than 1,000 requests, plus one for each downloaded KiB.
   */
  request(where: string): void {
    const allowed = FREE_REQUESTS + Math.floor(this.#arrived / 1024);
    if (++this.#requests > allowed)
      refuse(where, `at most ${grouped(allowed)} requests for ${grouped(this.#arrived)} bytes that arrived`, 'more');
  }

  /** Adds the size of another downloaded file of the scene, in bytes, which raises {@link allowed}. */
  arrive(bytes: number): void {
    this.#arrived += bytes;
  }

  /**
   * Charges bytes before they are allocated, and checks the time limit.
   * @param where Name of the file in error messages.
   * @throws GaussianSplatError `out-of-memory/budget` if the total exceeds {@link allowed}, or the load takes longer than
   * `maxSeconds`.
   */
  take(bytes: number, where: string): void {
    this.#taken += bytes;
    const { allowed } = this;
    // The negated comparison refuses NaN, too.
    if (!(this.#taken <= allowed))
      refuse(
        where,
        `at most ${grouped(allowed)} bytes of memory for ${grouped(this.#arrived)} that arrived`,
        `${grouped(this.#taken)} or more`,
      );
    const { maxSeconds = Infinity } = this.#limits;
    if (performance.now() - this.#start > 1000 * maxSeconds) refuse(where, `at most ${maxSeconds} s`, 'more');
  }

  /**
   * Charges the arrays of a cloud of `count` splats.
   * @param where Name of the file in error messages.
   * @throws GaussianSplatError `out-of-memory/budget` if `count` exceeds `maxSplats`, or as {@link take} does.
   */
  takeSplats(count: number, degree: ShDegree, where: string): void {
    const { maxSplats = Infinity } = this.#limits;
    if (count > maxSplats) refuse(where, `at most ${grouped(maxSplats)} splats`, grouped(count));
    this.take(4 * count * (11 + 3 * shCoefficientCount(degree)), where);
  }
}

/**
 * Throws `out-of-memory/budget` for an exceeded limit.
 * @param where Name of the file in error messages.
 * @param expected The limit, for example `at most 5 s`.
 * @param found The value that exceeds the limit.
 */
export function refuse(where: string, expected: string, found: string, cause?: unknown): never {
  throw new GaussianSplatError('out-of-memory/budget', {
    where,
    expected,
    found,
    remedy: 'use a smaller scene, or raise the limit',
    cause,
  });
}
