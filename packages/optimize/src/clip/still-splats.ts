/** Finds the splats of a sequence that never change, so that a clip has them once. */
import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { splatsOf } from '../reduce.js';
import { PlaceGrid } from './place-grid.js';

/**
 * Maximum differences of splats that count as equal, at {@link USUAL_PSNR}: of positions, relative to the middle scale;
 * of rotations in radians; of scales' natural logarithms; of opacities; and of coefficients. They are small fractions of
 * quantization steps.
 */
const SAME = { position: 0.03, rotation: 0.03, scale: 0.03, opacity: 0.006, color: 0.015 } as const;
const USUAL_PSNR = 45;
/** Minimum fraction of a frame's splats that must be still, so that a part of their own saves bytes. */
const MIN_SHARE = 0.05;
/** Maximum number of splats that estimate the typical size. */
const SAMPLES = 1000;

/** Matches splats that never change with the splats of frames. */
export class StillSplats {
  readonly cloud: GaussianCloud;
  readonly #factor: number;
  readonly #cell: number;
  /** [still splats] index of each splat in the frame that was matched last: a first guess for the next frame. */
  readonly #last: Int32Array;

  constructor(cloud: GaussianCloud, minPsnr: number) {
    this.cloud = cloud;
    this.#factor = 10 ** ((USUAL_PSNR - minPsnr) / 20);
    this.#last = Int32Array.from({ length: cloud.count }, (_, i) => i);
    this.#cell = this.#factor * SAME.position * Math.max(1e-12, typicalSize(cloud));
  }

  /**
   * Finds the splats that are the same in all frames. Frames are read once, one after the other.
   * @param openFrame Reads a frame by its index.
   * @param minPsnr Target PSNR of the clip in dB, which determines what counts as the same.
   * @returns Undefined if there are too few of them.
   */
  static async find(
    openFrame: (frame: number) => Promise<GaussianCloud>,
    frameCount: number,
    minPsnr: number,
  ): Promise<StillSplats | undefined> {
    const first = await openFrame(0);
    let still = new StillSplats(first, minPsnr);
    let [fewest, largest] = [first.count, first.count];
    const min = (): number => Math.max(1, MIN_SHARE * largest);
    for (let frame = 1; frame < frameCount; frame++) {
      const cloud = await openFrame(frame);
      [fewest, largest] = [Math.min(fewest, cloud.count), Math.max(largest, cloud.count)];
      const matches = still.#match(cloud);
      if (matches.some((i) => i < 0)) still = still.#only(matches);
      if (still.cloud.count < min()) return undefined;
    }
    // A group has at least one splat of its own.
    const kept = Math.min(still.cloud.count, fewest - 1);
    if (kept < min()) return undefined;
    return kept === still.cloud.count ? still : still.#only(still.#last.map((i, k) => (k < kept ? i : -1)));
  }

  /** Returns the splats of a frame that are not these. */
  without(frame: GaussianCloud): GaussianCloud {
    const isStill = new Uint8Array(frame.count);
    for (const i of this.#match(frame)) if (i >= 0) isStill[i] = 1;
    const rest: number[] = [];
    for (let i = 0; i < frame.count; i++) if (isStill[i] === 0) rest.push(i);
    return splatsOf(frame, Uint32Array.from(rest));
  }

  #only(matches: Int32Array): StillSplats {
    const kept = Uint32Array.from(matches.keys()).filter((k) => matches[k] >= 0);
    const still = new StillSplats(splatsOf(this.cloud, kept), USUAL_PSNR - 20 * Math.log10(this.#factor));
    kept.forEach((k, place) => (still.#last[place] = matches[k]));
    return still;
  }

  /** Returns the index of each splat in a frame, or -1 for splats that the frame does not have. */
  #match(frame: GaussianCloud): Int32Array {
    const found = new Int32Array(this.cloud.count).fill(-1);
    if (frame.shDegree !== this.cloud.shDegree) return found;
    const isTaken = new Uint8Array(frame.count);
    const shift = frame.origin.map((value, axis) => value - this.cloud.origin[axis]);
    const isFree = (k: number, i: number): boolean =>
      i < frame.count && isTaken[i] === 0 && this.#isSame(k, frame, i, shift);
    let grid: PlaceGrid | undefined;
    for (let k = 0; k < found.length; k++) {
      let match = isFree(k, this.#last[k]) ? this.#last[k] : -1;
      if (match < 0) {
        const positions = (): Float32Array => frame.positions.map((value, n) => value + shift[n % 3]);
        grid ??= new PlaceGrid(positions(), frame.count, this.#cell);
        grid.forEachNear(this.cloud.positions, k, (i) => {
          if (!isFree(k, i)) return false;
          match = i;
          return true;
        });
      }
      if (match < 0) continue;
      found[k] = match;
      isTaken[match] = 1;
      this.#last[k] = match;
    }
    return found;
  }

  #isSame(k: number, frame: GaussianCloud, i: number, shift: readonly number[]): boolean {
    const { cloud } = this;
    const factor = this.#factor;
    if (Math.abs(cloud.opacities[k] - frame.opacities[i]) > factor * SAME.opacity) return false;
    const [a, b, c] = [cloud.scales[3 * k], cloud.scales[3 * k + 1], cloud.scales[3 * k + 2]];
    const middle = Math.max(Math.min(a, b), Math.min(Math.max(a, b), c));
    let cosine = 0;
    for (let axis = 0; axis < 3; axis++) {
      const moved = cloud.positions[3 * k + axis] - frame.positions[3 * i + axis] - shift[axis];
      if (Math.abs(moved) > factor * SAME.position * middle) return false;
      const grown = Math.log((cloud.scales[3 * k + axis] + 1e-12) / (frame.scales[3 * i + axis] + 1e-12));
      if (Math.abs(grown) > factor * SAME.scale) return false;
    }
    for (let n = 0; n < 4; n++) cosine += cloud.rotations[4 * k + n] * frame.rotations[4 * i + n];
    if (2 * Math.acos(Math.min(1, Math.abs(cosine))) > factor * SAME.rotation) return false;
    const numbers = 3 * shCoefficientCount(cloud.shDegree);
    for (let n = 0; n < numbers; n++)
      if (Math.abs(cloud.sh[numbers * k + n] - frame.sh[numbers * i + n]) > factor * SAME.color) return false;
    return true;
  }
}

/** Returns the median of the middle scales of some splats. */
function typicalSize({ scales, count }: GaussianCloud): number {
  const stride = Math.max(1, Math.floor(count / SAMPLES));
  const sizes: number[] = [];
  for (let i = 0; i < count; i += stride) sizes.push([...scales.subarray(3 * i, 3 * i + 3)].sort((a, b) => a - b)[1]);
  return sizes.sort((a, b) => a - b)[sizes.length >> 1] ?? 0;
}
