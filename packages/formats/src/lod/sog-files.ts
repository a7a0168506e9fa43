import { GaussianSplatError, keepUsable, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { SharedReads } from '@gaussian-splat/core/fetch';
import { LoadBudget } from '../budget.js';
import { grouped } from '../bytes.js';
import { checkedPart } from '../foreign-signatures.js';
import { damaged } from '../faults.js';
import { partAddress } from '../fetch-scene.js';
import { readSogPart } from '../sog/read-sog.js';
import type { SogAddress, SogRun } from './boxes.js';

/** Fetches a file; aborted when no caller waits for it. */
export type FetchBytes = (url: string, signal: AbortSignal) => Promise<Uint8Array>;

/** Maximum number of files in progress: one is fetched while the other is decoded. */
const FILES_AT_A_TIME = 2;

/**
 * Runs of splats from the SOG files of streamed scenes. A file holds many runs: concurrent requests share one read, and
 * recently used files are cached, up to a number of bytes.
 */
export class SogFiles {
  readonly #reads: SharedReads<GaussianCloud>;
  readonly #gate = new Gate(FILES_AT_A_TIME);
  /** Downloaded bytes of each cloud. */
  readonly #arrived = new WeakMap<GaussianCloud, number>();

  /** @param keptBytes Limit of the cache of decoded splats, default 128 MB; the last file is always kept. */
  constructor(keptBytes?: number) {
    this.#reads = new SharedReads(byteLengthOf, keptBytes);
  }

  /**
   * Reads the splats of a run, without unusable ones.
   * @param fetch Fetches uncached files.
   * @param budget Account of the scene; without it each file has its own.
   * @throws GaussianSplatError `decode/*`, `decode/corrupt` for a run beyond its file, `decode/empty` for one without
   * usable splats, `out-of-memory/budget`; errors of `fetch`; the reason of `signal` as soon as that is aborted.
   */
  async read(
    run: Omit<SogRun, 'file'>,
    fetch: FetchBytes,
    signal?: AbortSignal,
    budget?: LoadBudget,
  ): Promise<GaussianCloud> {
    const cloud = keepUsable(cut(await this.open(run, fetch, signal, budget), run));
    if (cloud.count > 0) return cloud;
    throw new GaussianSplatError('decode/empty', {
      where: whereOf(run),
      expected: '1 splat or more that can be drawn',
      found: `${grouped(run.count)} with values that cannot be drawn`,
      remedy: 'export the scene again; until then a coarser level is shown here',
    });
  }

  /** All splats of a file, in its order; read-only. Throws as {@link read} does. */
  async open(file: SogAddress, fetch: FetchBytes, signal?: AbortSignal, budget?: LoadBudget): Promise<GaussianCloud> {
    const isKept = this.#reads.has(file.url);
    // A read that another scene started is limited by the budget of that scene.
    const cloud = await this.#reads.read(file.url, (ended) => this.#read(file, fetch, ended, budget), signal, budget);
    // A cached file costs nothing more, but copies of its splats are charged.
    if (isKept) budget?.arrive(this.#arrived.get(cloud) ?? 0);
    return cloud;
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
      const bytes = await checkedPart(await fetch(url, signal), name);
      const budget = shared ?? new LoadBudget(0);
      let arrived = 0;
      const arrive = (part: Uint8Array): Uint8Array => {
        arrived += part.length;
        budget.arrive(part.length);
        return part;
      };
      arrive(bytes);
      const open = async (path: string): Promise<Uint8Array> =>
        arrive(await fetch(partAddress(url, path).href, signal));
      const cloud = await readSogPart({ bytes, name, budget, signal }, open);
      this.#arrived.set(cloud, arrived);
      return cloud;
    } finally {
      leave();
    }
  }
}

const whereOf = ({ name, first, count }: Omit<SogRun, 'file'>): string =>
  `${name}, splats ${grouped(first)} to ${grouped(first + count)}`;

const byteLengthOf = ({ positions, scales, rotations, opacities, sh }: GaussianCloud): number =>
  [positions, scales, rotations, opacities, sh].reduce((sum, { byteLength }) => sum + byteLength, 0);

/**
 * Copies some splats of a cloud to new arrays.
 * @param budget Is charged for them.
 * @throws GaussianSplatError `decode/corrupt` if the cloud has too few.
 */
export function cut(cloud: GaussianCloud, run: Omit<SogRun, 'file'>, budget?: LoadBudget): GaussianCloud {
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

  /** Waits for a permit. @returns A function that releases it. */
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
