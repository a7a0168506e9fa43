import type { GaussianCloud } from '@gaussian-splat/core';

/** Delay of the first preview after the start of the load, ms. Shorter downloads need no preview. */
const FIRST_AFTER_MS = 300;
/** Factor by which the number of shards grows from one preview to the next. */
const GROWTH = 2;
/** Approximate maximum number of splats in a preview, so that packing it takes little time. */
const MAX_SPLATS = 50_000;
/** Maximum fraction of the loading time that previews may take. */
const MAX_SHARE = 0.05;

/**
 * Creates previews of a scene from the shards that have been packed. A preview contains some of their splats, enlarged
 * to represent the rest.
 */
export class PartPreviews {
  readonly #show: (cloud: GaussianCloud) => void;
  readonly #parts: (GaussianCloud | undefined)[];
  readonly #start = performance.now();
  #spentMs = 0;
  #there = 0;
  #due = 1;

  /**
   * @param shares Number of shards in the scene.
   * @param show Packs and posts a preview.
   */
  constructor(shares: number, show: (cloud: GaussianCloud) => void) {
    this.#show = show;
    this.#parts = new Array<undefined>(shares);
  }

  add(share: number, part: GaussianCloud): void {
    if (this.#parts[share] === undefined) this.#there++;
    this.#parts[share] = part;
  }

  forget(): void {
    this.#parts.fill(undefined);
    this.#there = 0;
  }

  showIfDue(): void {
    const began = performance.now();
    const elapsed = began - this.#start;
    const isDue = elapsed >= FIRST_AFTER_MS && this.#there >= this.#due && this.#spentMs <= MAX_SHARE * elapsed;
    if (!isDue || this.#there === this.#parts.length) return;
    this.#show(thinned(this.#parts.filter((part) => part !== undefined)));
    this.#due = GROWTH * this.#there;
    this.#spentMs += performance.now() - began;
  }
}

/**
 * Returns a cloud of every n-th splat of several clouds, about {@link MAX_SPLATS} in total, enlarged by the square root
 * of n. View-dependent color is omitted.
 */
function thinned(parts: readonly GaussianCloud[]): GaussianCloud {
  const all = parts.reduce((sum, { count }) => sum + count, 0);
  const step = Math.ceil(all / MAX_SPLATS);
  const picked = parts.map(({ count }) => Math.ceil(count / step));
  const count = picked.reduce((sum, n) => sum + n, 0);
  const take = (name: 'positions' | 'scales' | 'rotations' | 'opacities' | 'sh', size: number): Float32Array => {
    const values = new Float32Array(size * count);
    let to = 0;
    parts.forEach((part, p) => {
      for (let i = 0; i < picked[p]; i++) for (let k = 0; k < size; k++) values[to++] = part[name][size * step * i + k];
    });
    return values;
  };
  const larger = Math.sqrt(step);
  return {
    ...parts[0],
    ...{ count, droppedCount: 0 },
    positions: take('positions', 3),
    scales: take('scales', 3).map((scale) => scale * larger),
    rotations: take('rotations', 4),
    opacities: take('opacities', 1),
    sh: take('sh', 3),
  };
}
