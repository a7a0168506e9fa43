/** Converts the splats of several frames to a base cloud and motion curves, as a part of a clip has them. */
import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import type { ClipPartContent } from '../clip/clip-parts.js';
import {
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  type AnimatedAttributeName,
  type AnimatedAttribute,
} from '../motion.js';
import { product } from './tracks.js';

/** Clouds of consecutive frames. Row i is the same splat in each cloud. */
export interface Moments {
  readonly clouds: readonly GaussianCloud[];
  /** For each frame, [rows]: 1 if the splat exists. Attributes of splats that do not exist are undefined. */
  readonly isThere: readonly Uint8Array[];
}

const MAX_CODE = 32_767;
/** Fraction of the largest change of positions; smaller deviations from a straight line are ignored. */
const NOTHING = 1e-6;

/**
 * Returns a base cloud and its motion over the frames. Positions that follow straight lines get one curve. Each other
 * attribute that changes gets one curve for each frame.
 */
export function sampledMotion({ clouds, isThere }: Moments): ClipPartContent {
  const [{ count, shDegree }] = clouds;
  const frames = clouds.length;
  const first = new Uint16Array(count);
  const end = new Uint16Array(count);
  for (let row = 0; row < count; row++) {
    first[row] = isThere.findIndex((there) => there[row]);
    end[row] = 1 + isThere.findLastIndex((there) => there[row]);
  }
  const base = rowsAt(clouds, first);
  const parts = Object.fromEntries(
    ANIMATED_ATTRIBUTE_NAMES.map((name): [AnimatedAttributeName, AnimatedAttribute] => {
      const changes = Array.from({ length: ANIMATED_ATTRIBUTES[name] }, () => new Float32Array(frames * count));
      for (let f = 0; f < frames; f++)
        for (let row = 0; row < count; row++)
          if (isThere[f][row]) putChange(name, base, clouds[f], row, frames, f, changes);
          else if (name === 'opacity') changes[0][frames * row + f] = -base.opacities[row];
      return [name, partOf(name, changes, base, first, end, frames)];
    }),
  ) as Record<AnimatedAttributeName, AnimatedAttribute>;
  return {
    cloud: { ...base, shDegree },
    motion: { splats: count, frames, parts, lives: { first, end }, turnsHarmonics: false },
  };
}

/** Returns a cloud whose row i is copied from the frame `moments[i]`. */
function rowsAt(clouds: readonly GaussianCloud[], moments: Uint16Array): GaussianCloud {
  const [{ count }] = clouds;
  const pick = (of: (cloud: GaussianCloud) => Float32Array): Float32Array => {
    const own = of(clouds[0]).slice();
    const width = own.length / count;
    for (let row = 0; row < count; row++)
      own.set(of(clouds[moments[row]]).subarray(width * row, width * (row + 1)), width * row);
    return own;
  };
  return {
    ...clouds[0],
    positions: pick((cloud) => cloud.positions),
    scales: pick((cloud) => cloud.scales),
    rotations: pick((cloud) => cloud.rotations),
    opacities: pick((cloud) => cloud.opacities),
    sh: pick((cloud) => cloud.sh),
  };
}

/** Writes the change of an attribute of a row relative to the base, in the units of {@link AnimatedAttribute}. */
function putChange(
  name: AnimatedAttributeName,
  base: GaussianCloud,
  cloud: GaussianCloud,
  row: number,
  frames: number,
  frame: number,
  changes: readonly Float32Array[],
): void {
  const at = frames * row + frame;
  if (name === 'opacity') changes[0][at] = cloud.opacities[row] - base.opacities[row];
  else if (name === 'rotation')
    turnBetween(base.rotations, cloud.rotations, row).forEach((v, k) => (changes[k][at] = v));
  else
    for (let k = 0; k < 3; k++) {
      if (name === 'position') changes[k][at] = cloud.positions[3 * row + k] - base.positions[3 * row + k];
      if (name === 'scale') changes[k][at] = Math.log(cloud.scales[3 * row + k] / base.scales[3 * row + k]);
      const width = 3 * shCoefficientCount(cloud.shDegree);
      if (name === 'color') changes[k][at] = cloud.sh[width * row + k] - base.sh[width * row + k];
    }
}

/** Returns the rotation vector from one quaternion to another. Its length is the angle in radians. */
function turnBetween(from: Float32Array, to: Float32Array, row: number): readonly number[] {
  const at = 4 * row;
  let same = true;
  for (let k = 0; k < 4; k++) same &&= from[at + k] === to[at + k];
  if (same) return [0, 0, 0];
  const inverse = [from[at], -from[at + 1], -from[at + 2], -from[at + 3]];
  const [w, x, y, z] = product(Array.from(to.subarray(at, at + 4)), inverse);
  const sine = Math.hypot(x, y, z);
  if (sine === 0) return [0, 0, 0];
  const angle = 2 * Math.atan2(sine, Math.abs(w)) * Math.sign(w || 1);
  return [x, y, z].map((value) => (angle * value) / sine);
}

function partOf(
  name: AnimatedAttributeName,
  changes: readonly Float32Array[],
  base: GaussianCloud,
  first: Uint16Array,
  end: Uint16Array,
  frames: number,
): AnimatedAttribute {
  const largest = changes.reduce((max, own) => own.reduce((m, value) => Math.max(m, Math.abs(value)), max), 0);
  const still: AnimatedAttribute = { rank: 0, aged: 0, step: 1, curves: new Float32Array(0), codes: [] };
  if (largest === 0) return still;
  const lines = name === 'position' ? linesOf(changes, first, end, frames, minOf(base, largest)) : undefined;
  if (lines) {
    // Positions of the base become those of the line at frame 0, even if the splat begins later.
    lines.forEach((own, k) => own.forEach((slope, row) => (base.positions[3 * row + k] -= slope * first[row])));
    const codes = coded(lines, 1);
    return {
      rank: 1,
      aged: 0,
      step: codes.step,
      curves: Float32Array.from({ length: frames }, (_, f) => f),
      codes: codes.codes,
    };
  }
  const curves = new Float32Array(frames * frames);
  for (let f = 0; f < frames; f++) curves[frames * f + f] = 1;
  return { rank: frames, aged: 0, curves, ...coded(changes, frames) };
}

/** Returns the smallest change of positions that is not ignored. It includes the rounding errors of float32 positions. */
const minOf = ({ positions }: GaussianCloud, largest: number): number =>
  Math.max(NOTHING * largest, positions.reduce((max, value) => Math.max(max, Math.abs(value)), 0) * 2 ** -22);

/** Returns the slope of each row, in units per frame, for each axis. Undefined if a row does not follow a straight line. */
function linesOf(
  changes: readonly Float32Array[],
  first: Uint16Array,
  end: Uint16Array,
  frames: number,
  min: number,
): Float32Array[] | undefined {
  const slopes = changes.map(() => new Float32Array(first.length));
  for (let k = 0; k < changes.length; k++)
    for (let row = 0; row < first.length; row++) {
      const [begin, last] = [first[row], end[row] - 1];
      const own = changes[k].subarray(frames * row, frames * (row + 1));
      const slope = last > begin ? own[last] / (last - begin) : 0;
      for (let f = begin + 1; f < last; f++)
        if (Math.abs(own[f] - slope * (f - begin)) > Math.max(min, 1e-5 * Math.abs(own[last]))) return undefined;
      slopes[k][row] = slope;
    }
  return slopes;
}

/** Quantizes numbers, [rows, rank], to 16-bit codes. Each of the `rank` columns becomes an array of codes. */
function coded(numbers: readonly Float32Array[], rank: number): { step: number; codes: Int16Array[] } {
  const largest = numbers.reduce((max, own) => own.reduce((m, value) => Math.max(m, Math.abs(value)), max), 0);
  const step = largest > 0 ? largest / MAX_CODE : 1;
  const codes = numbers.flatMap((own) =>
    Array.from({ length: rank }, (_, k) =>
      Int16Array.from({ length: own.length / rank }, (__, row) => Math.round(own[rank * row + k] / step)),
    ),
  );
  return { step, codes };
}
