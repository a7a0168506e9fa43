/** Depth and identity of each pixel, by their definitions in docs/depth.md. */
import type { ScreenSplat } from './blend.js';

/** Rows run from the top, pixels within a row from the left. */
export interface OracleDepths {
  /** [height, width] mean of the depths of the splats by their weights; 0 if nothing is drawn. */
  readonly expected: Float64Array;
  /** [height, width] depth of the splat that leaves half of the light or less; 0 if none does. */
  readonly median: Float64Array;
  /** [height, width] owner with the largest sum of weights, plus 1; 0 if nothing is drawn. */
  readonly ids: Uint32Array;
  /** [height, width] sum of weights of that owner, less that of the next one. */
  readonly lead: Float64Array;
}

/** Sums over the fragments of each pixel. */
export class DepthAndIds {
  readonly #width: number;
  readonly #sums: Float64Array;
  readonly #weights: Float64Array;
  readonly #median: Float64Array;
  readonly #owned: readonly Map<number, number>[];

  constructor(width: number, height: number) {
    this.#width = width;
    [this.#sums, this.#weights, this.#median] = [0, 1, 2].map(() => new Float64Array(width * height));
    this.#owned = Array.from({ length: width * height }, () => new Map<number, number>());
  }

  add(pixel: number, { owner, depth: center, depthAt }: ScreenSplat, before: number, after: number): void {
    const densest = depthAt!(pixel % this.#width, Math.floor(pixel / this.#width));
    const depth = Math.min(2 * center, Math.max(0.5 * center, densest));
    const weight = before - after;
    this.#sums[pixel] += weight * depth;
    this.#weights[pixel] += weight;
    if (before > 0.5 && after <= 0.5) this.#median[pixel] = depth;
    const own = this.#owned[pixel];
    own.set(owner, (own.get(owner) ?? 0) + weight);
  }

  result(): OracleDepths {
    const ranked = this.#owned.map((own) => [...own].sort(([a, x], [b, y]) => y - x || a - b));
    return {
      expected: this.#sums.map((sum, pixel) => (sum > 0 ? sum / this.#weights[pixel] : 0)),
      median: this.#median,
      ids: Uint32Array.from(ranked, ([first]) => (first ? first[0] + 1 : 0)),
      lead: Float64Array.from(ranked, ([first, next]) => (first ? first[1] - (next?.[1] ?? 0) : 0)),
    };
  }
}
