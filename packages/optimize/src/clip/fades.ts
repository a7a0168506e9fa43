import { FADE_NAMES, fadeAt, type Fades, type Lives } from '@gaussian-splat/formats';

/** Minimum fraction of its largest opacity after a splat has appeared. */
const WHOLE = 0.98;
/** Maximum fraction of the squared change that may remain after subtracting a fade. Other fades are not used. */
const MAX_LEFT = 0.5;

/**
 * Finds fades at the ends of lifetimes, which are linear over the frames, and subtracts them from changes of opacity.
 * @param changes [splats, frames] difference of each opacity from the splat's largest opacity. Fades are subtracted in
 * place.
 * @param opacities [splats] largest opacity of each splat.
 */
export function takeFades(
  changes: Float32Array,
  frames: number,
  opacities: Float32Array,
  lives: Pick<Lives, 'first' | 'end'>,
): Fades {
  const count = opacities.length;
  const fades = Object.fromEntries(FADE_NAMES.map((name) => [name, new Uint8Array(count)])) as Record<
    keyof Fades,
    Uint8Array
  >;
  for (let i = 0; i < count; i++) {
    const [first, end] = [lives.first[i], lives.end[i]];
    const row = changes.subarray(frames * i, frames * (i + 1));
    const fractionAt = (frame: number): number => 1 + row[frame] / opacities[i];
    const [begin, rise] = lineOf((age) => fractionAt(first + age), end - first);
    const [last, fall] = lineOf((age) => fractionAt(end - 1 - age), end - first);
    const put = (...values: readonly number[]): void => FADE_NAMES.forEach((name, k) => (fades[name][i] = values[k]));
    put(begin, rise, last, fall);
    const left = (frame: number): number => row[frame] - opacities[i] * (fadeAt(fades, lives, i, frame) - 1);
    let [before, after] = [0, 0];
    for (let f = first; f < end; f++) {
      before += row[f] ** 2;
      after += left(f) ** 2;
    }
    if (after > MAX_LEFT * before) {
      put(255, 0, 255, 0);
      continue;
    }
    for (let f = first; f < end; f++) row[f] = left(f);
    // Changes remain constant before and after the lifetime, as those of `changesOfTracks`.
    row.fill(row[first], 0, first);
    row.fill(row[end - 1], end);
  }
  return fades;
}

/**
 * Returns the least squares line through the fractions of opacity before a splat has appeared: the first value, and the
 * change per frame, in 255ths.
 */
function lineOf(fractionAt: (age: number) => number, length: number): readonly [begin: number, slope: number] {
  let [n, sum, sumOfAges, sumOfSquares, sumOfProducts] = [0, 0, 0, 0, 0];
  for (let age = 0; age < length && fractionAt(age) < WHOLE; age++) {
    const value = fractionAt(age);
    n++;
    sum += value;
    sumOfAges += age;
    sumOfSquares += age * age;
    sumOfProducts += age * value;
  }
  if (n === 0) return [255, 0];
  const slope = n > 1 ? (n * sumOfProducts - sumOfAges * sum) / (n * sumOfSquares - sumOfAges ** 2) : 1 - sum;
  const rise = byteOf(slope);
  return [byteOf((sum - (rise / 255) * sumOfAges) / n), rise];
}

const byteOf = (fraction: number): number => Math.min(255, Math.max(0, Math.round(255 * fraction)));
