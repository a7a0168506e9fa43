import { GaussianSplatError, keepUsable, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { SharedReads } from '@gaussian-splat/core/fetch';
import { LoadBudget } from '../budget.js';
import { grouped } from '../bytes.js';
import { checkedPart } from '../foreign-signatures.js';
import { damaged } from '../faults.js';
import { partAddress } from '../fetch-scene.js';
import { readSogPart } from '../sog/read-sog.js';
import type { SogAddress, SogRun } from './boxes.js';

/** Fetches a file by its absolute URL. The signal aborts when no caller waits for the file. */
export type FetchBytes = (url: string, signal: AbortSignal) => Promise<Uint8Array>;

/** Maximum number of files in progress, so that one is fetched while another is decoded. */
const FILES_AT_A_TIME = 2;

/**
 * Reads ranges of splats from the SOG files of streamed scenes. Concurrent requests for the same file cause one read.
 * Recently used files are cached, up to a number of bytes.
 */
export class SogFiles {
  readonly #reads: SharedReads<GaussianCloud>;
  readonly #gate = new Gate(FILES_AT_A_TIME);
  /** Number of downloaded bytes of each cloud. */
  readonly #arrived = new WeakMap<GaussianCloud, number>();

  /** @param keptBytes Maximum bytes of decoded splats in the cache, default 128 MB. The last file is always cached. */
  constructor(keptBytes?: number) {
    this.#reads = new SharedReads(byteLengthOf, keptBytes);
  }

  /**
   * Reads a range of splats of a file, without unusable splats.
   * @param fetch Fetches files that are not cached.
   * @param budget Account of the scene. Without it, each file has its own account.
   * @throws GaussianSplatError `decode/...`, including `decode/corrupt` for a range beyond its file and `decode/empty` for
   * one without usable splats; `out-of-memory/budget`; errors of `fetch`; the reason of `signal` as soon as it aborts.
   */
  async read(
    run: Omit<SogRun, 'file'>,
    fetch: FetchBytes,
    signal?: AbortSignal,
    budget?: LoadBudget,
  ): Promise<GaussianCloud> {
    const cloud = keepUsable(cut(await this.#shared(run, fetch, signal, budget), run));
    if (cloud.count > 0) return cloud;
    throw new GaussianSplatError('decode/empty', {
      where: whereOf(run),
      expected: '1 splat or more that can be drawn',
      found: `${grouped(run.count)} with values that cannot be drawn`,
      remedy: 'export the scene again; until then a coarser level is shown here',
    });
  }

  /** Reads all splats of a file, in its order. Do not modify the cloud, which is cached. Throws as {@link read} does. */
  async open(file: SogAddress, fetch: FetchBytes, signal?: AbortSignal, budget?: LoadBudget): Promise<GaussianCloud> {
    const isKept = this.#reads.has(file.url);
    const cloud = await this.#shared(file, fetch, signal, budget);
    // A cached file raises the limit as a downloaded one, because the caller charges copies of its splats.
    if (isKept) budget?.arrive(this.#arrived.get(cloud) ?? 0);
    return cloud;
  }

  /** Returns all splats of a file. If another scene has started the read, the budget of that scene limits it. */
  #shared(file: SogAddress, fetch: FetchBytes, signal?: AbortSignal, budget?: LoadBudget): Promise<GaussianCloud> {
    return this.#reads.read(file.url, (ended) => this.#read(file, fetch, ended, budget), signal, budget);
  }

  async #read(
    { url, name }: SogAddress,
    fetch: FetchBytes,
    signal: AbortSignal,
    shared: LoadBudget | undefined,
  ): Promise<GaussianCloud> {
    const leave = await this.#gate.enter();
    try {
      signal.throwIfAborted();
      const budget = shared ?? new LoadBudget(0);
      let arrived = 0;
      const open = async (address: string): Promise<Uint8Array> => {
        budget.request(name);
        const part = await fetch(address, signal);
        arrived += part.length;
        budget.arrive(part.length);
        return part;
      };
      const bytes = await checkedPart(await open(url), name);
      const cloud = await readSogPart({ bytes, name, budget, signal }, (path) => open(partAddress(url, path).href));
      this.#arrived.set(cloud, arrived);
      return cloud;
    } finally {
      leave();
    }
  }
}

const whereOf = ({ name, first, count }: Omit<SogRun, 'file' | 'url'>): string =>
  `${name}, splats ${grouped(first)} to ${grouped(first + count)}`;

const byteLengthOf = ({ positions, scales, rotations, opacities, sh }: GaussianCloud): number =>
  [positions, scales, rotations, opacities, sh].reduce((sum, { byteLength }) => sum + byteLength, 0);

/**
 * Copies a range of splats of a cloud to new arrays.
 * @param budget Account that is charged for the new arrays.
 * @throws GaussianSplatError `decode/corrupt` if the range exceeds the cloud; `out-of-memory/budget`
 */
export function cut(cloud: GaussianCloud, run: Omit<SogRun, 'file' | 'url'>, budget?: LoadBudget): GaussianCloud {
  const { first, count, name } = run;
  if (first + count > cloud.count) {
    throw damaged(
      whereOf(run),
      `runs within the ${grouped(cloud.count)} splats of the file`,
      'one that reaches beyond',
    );
  }
  budget?.takeSplats(count, cloud.shDegree, name);
  const part = (values: Float32Array, stride: number): Float32Array =>
    values.slice(stride * first, stride * (first + count));
  return {
    ...cloud,
    count,
    positions: part(cloud.positions, 3),
    scales: part(cloud.scales, 3),
    rotations: part(cloud.rotations, 4),
    opacities: part(cloud.opacities, 1),
    sh: part(cloud.sh, 3 * shCoefficientCount(cloud.shDegree)),
  };
}

/** A first-in, first-out semaphore. */
class Gate {
  #free: number;
  readonly #queue: (() => void)[] = [];

  constructor(places: number) {
    this.#free = places;
  }

  /** Waits for a permit. @returns A function that releases the permit. */
  async enter(): Promise<() => void> {
    if (this.#free > 0) this.#free--;
    else await new Promise<void>((resolve) => this.#queue.push(resolve));
    return () => {
      const next = this.#queue.shift();
      if (next) next();
      else this.#free++;
    };
  }
}
