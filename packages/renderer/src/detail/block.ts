import { constants } from '../generated/shaders.js';
import { FACTOR_NUMBERS, shNumbers, type SplatLevel } from './splat-level.js';

/** Splats that are merged among one another: those of the chunks that get one parent. */
export const BLOCK = 4 * constants.CULL_GROUP;

const SH_C0 = 0.28209479177387814;
/** Keeps shares of splats that cover nothing finite. */
const TINY = 1e-30;

const column = (): Float64Array => new Float64Array(BLOCK);

/** The splats of a block while they are merged, a column for each number. */
export class Block {
  count = 0;
  /** See {@link SplatLevel.dilation}. */
  dilation = 0;
  readonly x = column();
  readonly y = column();
  readonly z = column();
  /** Covariances. */
  readonly xx = column();
  readonly xy = column();
  readonly xz = column();
  readonly yy = column();
  readonly yz = column();
  readonly zz = column();
  /** Mean colour, of degree 0 alone. */
  readonly red = column();
  readonly green = column();
  readonly blue = column();
  readonly opacity = column();
  /** What a splat weighs in every mean: opacity times area of the splats that it stands for. */
  readonly mass = column();
  /** Mean square displacement so far. */
  readonly spread = column();
  readonly #columns = [
    ...[this.x, this.y, this.z, this.xx, this.xy, this.xz, this.yy, this.yz, this.zz],
    ...[this.red, this.green, this.blue, this.opacity, this.mass, this.spread],
  ];
  /** Of each splat that was loaded: its mass, and the splat that it is now part of. */
  readonly #loadedMass = column();
  readonly #cluster = new Int32Array(BLOCK);
  readonly #place = new Int32Array(BLOCK);
  #loaded = 0;

  /** Takes over `count` splats of a level from `first` on, at most {@link BLOCK}. */
  load(level: SplatLevel, first: number, count: number): void {
    const { positions, opacities, sh, shOrder, shDegree, spreads } = level;
    const stride = shNumbers(shDegree);
    for (let k = 0; k < count; k++) {
      const i = first + k;
      this.x[k] = positions[3 * i];
      this.y[k] = positions[3 * i + 1];
      this.z[k] = positions[3 * i + 2];
      this.#loadCovariance(k, level.factors, FACTOR_NUMBERS * i);
      const color = stride * (shOrder === undefined ? i : shOrder[i]);
      this.red[k] = SH_C0 * sh[color];
      this.green[k] = SH_C0 * sh[color + 1];
      this.blue[k] = SH_C0 * sh[color + 2];
      this.opacity[k] = opacities[i];
      this.mass[k] = opacities[i] * this.area(k) + TINY;
      this.#loadedMass[k] = this.mass[k];
      this.spread[k] = spreads[i];
      this.#cluster[k] = k;
    }
    this.#loaded = count;
    this.dilation = level.dilation;
    this.count = count;
  }

  /** Area of a splat, its variances larger by `low`, in units of 2π: the sum of what the three axes see. */
  area(k: number, low = 0): number {
    const { xx, xy, xz, yy, yz, zz } = this;
    return (
      Math.sqrt(Math.max(0, (xx[k] + low) * (yy[k] + low) - xy[k] * xy[k])) +
      Math.sqrt(Math.max(0, (xx[k] + low) * (zz[k] + low) - xz[k] * xz[k])) +
      Math.sqrt(Math.max(0, (yy[k] + low) * (zz[k] + low) - yz[k] * yz[k]))
    );
  }

  /** Drops the splats that have become part of another: `partOf[k]` is that other, or -1. The rest keep their order. */
  closeRanks(partOf: Int32Array): void {
    let kept = 0;
    for (let k = 0; k < this.count; k++) {
      if (partOf[k] >= 0) continue;
      this.#place[k] = kept;
      if (kept !== k) for (const values of this.#columns) values[kept] = values[k];
      kept++;
    }
    for (let i = 0; i < this.#loaded; i++) {
      const now = this.#cluster[i];
      this.#cluster[i] = this.#place[partOf[now] >= 0 ? partOf[now] : now];
    }
    this.count = kept;
  }

  /** Writes the splats to a level from `at` on; `source` and `first` are what was loaded. */
  store(level: SplatLevel, at: number, source: SplatLevel, first: number): void {
    for (let k = 0; k < this.count; k++) {
      level.positions[3 * (at + k)] = this.x[k];
      level.positions[3 * (at + k) + 1] = this.y[k];
      level.positions[3 * (at + k) + 2] = this.z[k];
      this.#storeFactor(k, level.factors, FACTOR_NUMBERS * (at + k));
      level.opacities[at + k] = this.opacity[k];
      level.spreads[at + k] = this.spread[k];
    }
    this.#storeSh(level, at, source, first);
  }

  #storeSh({ sh, shDegree }: SplatLevel, at: number, source: SplatLevel, first: number): void {
    const stride = shNumbers(shDegree);
    for (let k = 0; k < this.#loaded; k++) {
      const cluster = this.#cluster[k];
      const share = this.#loadedMass[k] / this.mass[cluster];
      const from = stride * (source.shOrder === undefined ? first + k : source.shOrder[first + k]);
      const to = stride * (at + cluster);
      for (let n = 0; n < stride; n++) sh[to + n] += share * source.sh[from + n];
    }
  }

  #loadCovariance(k: number, factors: Float32Array, at: number): void {
    const xx = factors[at];
    const yx = factors[at + 1];
    const yy = factors[at + 2];
    const zx = factors[at + 3];
    const zy = factors[at + 4];
    const zz = factors[at + 5];
    this.xx[k] = xx * xx;
    this.xy[k] = xx * yx;
    this.xz[k] = xx * zx;
    this.yy[k] = yx * yx + yy * yy;
    this.yz[k] = yx * zx + yy * zy;
    this.zz[k] = zx * zx + zy * zy + zz * zz;
  }

  /** The Cholesky factor; of flat splats and needles with zeros where rounding has left less than nothing. */
  #storeFactor(k: number, out: Float32Array, at: number): void {
    const xx = Math.sqrt(Math.max(0, this.xx[k]));
    const inverseX = xx > 0 ? 1 / xx : 0;
    const yx = this.xy[k] * inverseX;
    const zx = this.xz[k] * inverseX;
    const yy = Math.sqrt(Math.max(0, this.yy[k] - yx * yx));
    const zy = yy > 0 ? (this.yz[k] - yx * zx) / yy : 0;
    out[at] = xx;
    out[at + 1] = yx;
    out[at + 2] = yy;
    out[at + 3] = zx;
    out[at + 4] = zy;
    out[at + 5] = Math.sqrt(Math.max(0, this.zz[k] - zx * zx - zy * zy));
  }
}
