import { constants } from '../generated/shaders.js';
import { FACTOR_NUMBERS, shNumbers, type LevelSource, type SplatLevel } from './splat-level.js';
import { areaOf, BLUE, covarianceOf, factorOf, GREEN, MASS, OPACITY, RED, ROW, SPREAD, X, Y, Z } from './splat-rows.js';

/** Maximum number of splats that are merged with one another: those of four chunks with the same parent. */
export const BLOCK = 4 * constants.CULL_GROUP;

const SH_C0 = 0.28209479177387814;
/** Added to denominators, so that ratios are finite for splats that cover nothing. */
const TINY = 1e-30;

/** The splats of a block while they are merged. */
export class Block {
  count = 0;
  /** Variance that the renderer adds to splats, in px²: see {@link LevelSource.dilation}. */
  dilation = 0;
  /** [count, ROW] properties of the splats: see splat-rows.ts. */
  readonly rows = new Float64Array(ROW * BLOCK);
  /** Spherical harmonics of the loaded splats, in their order. */
  readonly #sh = new Float32Array(shNumbers(3) * BLOCK);
  /** {@link MASS} of each loaded splat before merging: opacity times area. */
  readonly #loadedMass = new Float64Array(BLOCK);
  /** Index of the merged splat that contains each loaded splat. */
  readonly #cluster = new Int32Array(BLOCK);
  readonly #place = new Int32Array(BLOCK);
  #loaded = 0;

  /** Loads `count` splats of a level, from index `first` on; at most {@link BLOCK}. */
  load(level: LevelSource, first: number, count: number): void {
    const { positions, factors, opacities, spreads, shDegree } = level;
    const { rows } = this;
    const sh = this.#sh;
    level.readSh(first, count, sh);
    const stride = shNumbers(shDegree);
    for (let k = 0, p = 0; k < count; k++, p += ROW) {
      const i = first + k;
      rows[p + X] = positions[3 * i];
      rows[p + Y] = positions[3 * i + 1];
      rows[p + Z] = positions[3 * i + 2];
      covarianceOf(factors, FACTOR_NUMBERS * i, rows, p);
      rows[p + RED] = SH_C0 * sh[stride * k];
      rows[p + GREEN] = SH_C0 * sh[stride * k + 1];
      rows[p + BLUE] = SH_C0 * sh[stride * k + 2];
      rows[p + OPACITY] = opacities[i];
      rows[p + SPREAD] = spreads[i];
      rows[p + MASS] = opacities[i] * areaOf(rows, p) + TINY;
      this.#loadedMass[k] = rows[p + MASS];
      this.#cluster[k] = k;
    }
    this.#loaded = count;
    this.dilation = level.dilation;
    this.count = count;
  }

  /**
   * Removes the splats that were merged into others. The other splats keep their order.
   * @param partOf Index of the splat into which each splat was merged, or -1.
   */
  closeRanks(partOf: Int32Array): void {
    const { rows } = this;
    let kept = 0;
    for (let k = 0; k < this.count; k++) {
      if (partOf[k] >= 0) continue;
      this.#place[k] = kept;
      if (kept !== k) for (let n = 0; n < ROW; n++) rows[ROW * kept + n] = rows[ROW * k + n];
      kept++;
    }
    const cluster = this.#cluster;
    for (let i = 0; i < this.#loaded; i++) {
      const now = cluster[i];
      cluster[i] = this.#place[partOf[now] >= 0 ? partOf[now] : now];
    }
    this.count = kept;
  }

  /** Writes the splats to a level, from index `at` on. */
  store(level: SplatLevel, at: number): void {
    const { rows } = this;
    for (let k = 0, p = 0; k < this.count; k++, p += ROW) {
      const to = 3 * (at + k);
      level.positions[to] = rows[p + X];
      level.positions[to + 1] = rows[p + Y];
      level.positions[to + 2] = rows[p + Z];
      factorOf(rows, p, level.factors, FACTOR_NUMBERS * (at + k));
      level.opacities[at + k] = rows[p + OPACITY];
      level.spreads[at + k] = rows[p + SPREAD];
    }
    this.#storeSh(level.sh, shNumbers(level.shDegree), at);
  }

  #storeSh(out: Float32Array, stride: number, at: number): void {
    const sh = this.#sh;
    for (let k = 0; k < this.#loaded; k++) {
      const cluster = this.#cluster[k];
      const share = this.#loadedMass[k] / this.rows[ROW * cluster + MASS];
      const from = stride * k;
      const to = stride * (at + cluster);
      for (let n = 0; n < stride; n++) out[to + n] += share * sh[from + n];
    }
  }
}
