/** Motion of version 4: range-coded lifetimes, curves and codes. One function describes the order of both directions. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { concatenated } from '@gaussian-splat/core/fetch';
import { grouped, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import {
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  FADE_NAMES,
  type AnimatedAttribute,
  type Fades,
  type Lives,
  type Motion,
} from '../motion.js';
import { codeCurves, type CurveBits } from './code-curves.js';
import { codeLives } from './code-lives.js';
import { NO_PLANES, PlaneModel, type EarlierPlanes, type KnownSplats } from './code-planes.js';
import { BitDecoder, BitEncoder, type BitCoder } from './range-coder.js';
import type { MotionFile } from './read-motion.js';

/** First byte of a file. No deflate stream begins with it, so that it differs from earlier versions. */
export const CODED_MARK = 255;
const VERSION = 4;
/** Mark, version, flags and a zero; splats and frames; for each attribute its rank, its aged curves, and its step. */
const HEAD_BYTES = 12 + 8 * ANIMATED_ATTRIBUTE_NAMES.length;
const FLAGS = { fades: 1, turnsHarmonics: 2 } as const;
/** Positions are rounded to this number of steps along each axis, and divided by {@link PLACE_UNIT}. */
const PLACE_STEPS = 4096;
const PLACE_UNIT = 512;
/** Bytes of temporary memory for each splat. */
const WORK_BYTES = 32;
/** Bytes charged for each code: 2 of memory, and the work of a decoder that reads almost nothing for it. */
const CODE_BYTES = 6;

/** Motion that is written: its curves are rounded as `roundCurve` rounds them. */
export interface WrittenMotion extends Motion {
  /** For each attribute, the number of fractional bits of each of its curves. */
  readonly curveBits: readonly CurveBits[];
}

/**
 * Returns the bytes of a motion file.
 * @param cloud The splats, as a reader decodes them from their scene file.
 */
export function writeCodedMotion(motion: WrittenMotion, cloud: MotionFile['cloud']): Uint8Array<ArrayBuffer> {
  const { splats, frames, parts, lives, turnsHarmonics } = motion;
  const head = new DataView(new ArrayBuffer(HEAD_BYTES));
  head.setUint8(0, CODED_MARK);
  head.setUint8(1, VERSION);
  head.setUint8(2, (lives.fades ? FLAGS.fades : 0) + (turnsHarmonics ? FLAGS.turnsHarmonics : 0));
  head.setUint32(4, splats, true);
  head.setUint32(8, frames, true);
  ANIMATED_ATTRIBUTE_NAMES.forEach((name, k) => {
    head.setUint16(12 + 8 * k, parts[name].rank, true);
    head.setUint16(14 + 8 * k, parts[name].aged, true);
    head.setFloat32(16 + 8 * k, parts[name].step, true);
  });
  const coder = new BitEncoder();
  codeMotion(coder, motion, motion.curveBits, cloud);
  return concatenated(Uint8Array, [new Uint8Array(head.buffer), coder.finish()]);
}

/** Reads motion of version 4. Throws as `readMotion` does. */
export function readCodedMotion({ bytes, name, cloud, frames, budget }: MotionFile): Motion {
  if (bytes.length < HEAD_BYTES)
    throw damaged(name, `a head of ${HEAD_BYTES} bytes`, grouped(bytes.length), 'decode/truncated');
  const head = viewOf(bytes);
  const [version, flags] = [head.getUint8(1), head.getUint8(2)];
  if (version !== VERSION || flags > FLAGS.fades + FLAGS.turnsHarmonics)
    throw damaged(name, `motion of version ${VERSION}`, `version ${version}, ${flags}`, 'decode/unsupported');
  const [splats, ownFrames] = [head.getUint32(4, true), head.getUint32(8, true)];
  if (splats !== cloud.count || ownFrames !== frames)
    throw damaged(
      name,
      `${grouped(frames)} frames of ${grouped(cloud.count)} splats`,
      `${grouped(ownFrames)} of ${grouped(splats)}`,
      'decode/header',
    );
  const hasFades = (flags & FLAGS.fades) > 0;
  budget.take((WORK_BYTES + 4 + (hasFades ? FADE_NAMES.length : 0)) * splats, name);
  const fades = (): Fades =>
    Object.fromEntries(FADE_NAMES.map((each) => [each, new Uint8Array(splats)])) as unknown as Fades;
  const lives: Lives = {
    first: new Uint16Array(splats),
    end: new Uint16Array(splats),
    ...(hasFades && { fades: fades() }),
  };
  const parts = ANIMATED_ATTRIBUTE_NAMES.map((attribute, k): [string, AnimatedAttribute] => {
    const [rank, aged] = [head.getUint16(12 + 8 * k, true), head.getUint16(14 + 8 * k, true)];
    const step = head.getFloat32(16 + 8 * k, true);
    if (rank > frames || aged > rank)
      throw damaged(name, `at most ${frames} curves`, `${rank} for ${attribute}, ${aged} of age`, 'decode/header');
    if (rank > 0 && !(step > 0 && step < Infinity)) throw damaged(name, 'steps above 0', `${step} for ${attribute}`);
    const planes = ANIMATED_ATTRIBUTES[attribute] * rank;
    budget.take(4 * frames * rank + CODE_BYTES * splats * planes, name);
    const codes = Array.from({ length: planes }, () => new Int16Array(splats));
    return [attribute, { rank, aged, step, curves: new Float32Array(frames * rank), codes }];
  });
  const motion: Motion = {
    ...{ splats, frames, lives, turnsHarmonics: (flags & FLAGS.turnsHarmonics) > 0 },
    parts: Object.fromEntries(parts) as Motion['parts'],
  };
  const coder = new BitDecoder(bytes.subarray(HEAD_BYTES));
  codeMotion(coder, motion, undefined, cloud);
  if (coder.left < 0) throw damaged(name, 'all codes of the motion', 'a part', 'decode/truncated');
  if (coder.left > 0) throw damaged(name, 'only codes of the motion', `${grouped(coder.left)} more bytes`);
  return motion;
}

/** Codes all that follows the head. A decoder fills the arrays of `motion`. */
function codeMotion(
  coder: BitCoder,
  { splats, frames, parts, lives }: Motion,
  curveBits: readonly CurveBits[] | undefined,
  { positions }: MotionFile['cloud'],
): void {
  codeLives(coder, lives, frames);
  const kinds = new Uint8Array(splats);
  for (let i = 0; i < splats; i++) kinds[i] = lives.first[i] > 0 || lives.end[i] < frames ? 1 : 0;
  const known: KnownSplats = { kinds, places: placesOf(positions, splats), isActive: new Uint8Array(splats) };
  ANIMATED_ATTRIBUTE_NAMES.forEach((name, k) => {
    codeCurves(coder, parts[name], frames, curveBits?.[k]);
    codePlanes(coder, parts[name], known);
  });
}

function codePlanes(coder: BitCoder, { rank, codes }: AnimatedAttribute, known: KnownSplats): void {
  const model = new PlaneModel(known);
  codes.forEach((plane, at) => {
    // The caller refuses a file that ends early.
    if (coder instanceof BitDecoder && coder.left < 0) return;
    const earlier = {
      number: at >= rank ? codes[at - rank] : NO_PLANES.number,
      curve: at % rank > 0 ? codes[at - 1] : NO_PLANES.curve,
    };
    const isPredicted =
      coder.plain(coder instanceof BitEncoder && isPredictable(plane, earlier, known) ? 1 : 0, 1) === 1;
    model.code(coder, plane, earlier, isPredicted);
  });
}

/** Returns whether a plane takes fewer bytes if its codes are predicted. */
function isPredictable(plane: Int16Array, earlier: EarlierPlanes, known: KnownSplats): boolean {
  const [plain, predicted] = [false, true].map((isPredicted) => {
    const coder = new BitEncoder();
    const own = { ...known, isActive: known.isActive.slice() };
    new PlaneModel(own).code(coder, plane, earlier, isPredicted);
    return coder.finish().length;
  });
  return predicted < plain;
}

/**
 * Returns positions relative to their bounds, [splats, 3] from -4 to 4. They are rounded, because machines may decode
 * positions with different last bits.
 */
function placesOf(positions: GaussianCloud['positions'], splats: number): Float64Array {
  const places = new Float64Array(3 * splats);
  for (let axis = 0; axis < 3; axis++) {
    let [min, max] = [Infinity, -Infinity];
    for (let i = 0; i < splats; i++) {
      const value = positions[3 * i + axis];
      if (value < min) min = value;
      if (value > max) max = value;
    }
    const size = max - min;
    if (!(size > 0 && size < Infinity)) continue;
    for (let i = 0; i < splats; i++) {
      const step = Math.floor((PLACE_STEPS * (positions[3 * i + axis] - min)) / size + 0.5);
      places[3 * i + axis] = (step >= 0 && step <= PLACE_STEPS ? step : 0) / PLACE_UNIT - PLACE_STEPS / PLACE_UNIT / 2;
    }
  }
  return places;
}
