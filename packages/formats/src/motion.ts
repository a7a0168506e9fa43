import { type GaussianSplatError, keepUsable, shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { type LoadBudget } from './budget.js';
import { GrowingBytes, grouped, viewOf } from './bytes.js';
import { decompressing } from './decompression.js';
import { checkedPart } from './foreign-signatures.js';
import { damaged } from './faults.js';
import { noSplats } from './scene-errors.js';

/** Animated attributes in the order of files, each with its count of numbers for a splat. */
export const ANIMATED_ATTRIBUTES = { position: 3, rotation: 3, scale: 3, opacity: 1, color: 3 } as const;
export type AnimatedAttributeName = keyof typeof ANIMATED_ATTRIBUTES;
export const ANIMATED_ATTRIBUTE_NAMES = Object.keys(ANIMATED_ATTRIBUTES) as readonly AnimatedAttributeName[];

/** Versions of files. `lives`: splats have lifetimes. `fades`: they fade, too. */
export const MOTION_VERSION = { lives: 2, fades: 3 } as const;
/** Size of the header: version, splats, frames, and a rank and a step for each of {@link ANIMATED_ATTRIBUTES}. */
const HEAD_BYTES = 4 * (3 + 2 * ANIMATED_ATTRIBUTE_NAMES.length);
/** Coding of a plane of codes: plain codes, or differences from the code of the previous splat. */
export const MOTION_MODES = { plain: 0, differences: 1 } as const;
/** Maximum absolute value of a curve. Normal curves have values of about 1. */
const MAX_CURVE = 1e6;

/**
 * Motion of one attribute. At frame f, number n of a splat's attribute changes by step · Σ_k curves[f, k] · codes[n, k].
 * The change of scales is in natural logarithms, and that of rotations is a rotation vector in radians.
 */
export interface AnimatedAttribute {
  /** Number of curves, which all splats share. 0 if the attribute does not change. */
  readonly rank: number;
  readonly step: number;
  /** Values of the curves, [frames, rank]. */
  readonly curves: Float32Array;
  /** Arrays of weights, [numbers of the attribute, rank]. Each array has the weight of one curve for each splat. */
  readonly codes: readonly Int16Array[];
}

/** Lifetime of each splat: frames from `first` to `end`, excluding `end`. Both arrays are [splats]. */
export interface Lives {
  readonly first: Uint16Array;
  readonly end: Uint16Array;
  /** Fades at the ends of the lifetimes. Undefined if all splats appear and disappear at once. */
  readonly fades?: Fades | undefined;
}

/**
 * Fade of each splat's opacity at the ends of its lifetime, in 255ths; the arrays are [splats]. At frame f, the fraction
 * of the opacity is min(255, begin + rise · (f − first), last + fall · (end − 1 − f)) / 255.
 */
export type Fades = Readonly<Record<(typeof FADE_NAMES)[number], Uint8Array>>;
export const FADE_NAMES = ['begin', 'rise', 'last', 'fall'] as const;

/** Returns the fraction of the opacity of splat `i`, 0..1, at a frame of its lifetime. */
export function fadeAt(
  { begin, rise, last, fall }: Fades,
  { first, end }: Pick<Lives, 'first' | 'end'>,
  i: number,
  frame: number,
): number {
  const [since, until] = [frame - first[i], end[i] - 1 - frame];
  return Math.min(255, begin[i] + rise[i] * since, last[i] + fall[i] * until) / 255;
}

/** Motion of all splats over some frames, relative to a cloud. */
export interface Motion {
  readonly splats: number;
  readonly frames: number;
  readonly parts: Readonly<Record<AnimatedAttributeName, AnimatedAttribute>>;
  readonly lives: Lives;
}

/** A motion file, and the counts of splats and frames that its header must have. */
export interface MotionFile {
  readonly bytes: Uint8Array;
  readonly name: string;
  readonly splats: number;
  readonly frames: number;
  readonly budget: LoadBudget;
}

/**
 * Reads a motion file, whose format docs/sequences.md describes.
 * @throws GaussianSplatError `decode/corrupt`, `decode/truncated`, `decode/unsupported`, `decode/header`, `decode/html`, `decode/lfs-pointer`, or `out-of-memory/budget`
 */
export async function readMotion({ bytes, name, ...asked }: MotionFile): Promise<Motion> {
  return new MotionReader(await inflate(await checkedPart(bytes, name), name, asked), name, asked).read();
}

type Asked = Pick<MotionFile, 'splats' | 'frames' | 'budget'>;

/** Inflates a file. Throws if the inflated size differs from the size that its header implies. */
async function inflate(bytes: Uint8Array, name: string, asked: Asked): Promise<Uint8Array> {
  const reader = decompressing(bytes, 'deflate-raw');
  const output = new GrowingBytes(65_536);
  let length: number | undefined;
  try {
    for (;;) {
      const { value } = await reader.read().catch((cause: unknown) => {
        throw damaged(name, 'an intact deflate stream', 'a damaged one', 'decode/corrupt', cause);
      });
      if (value === undefined) break;
      output.append(value);
      if (length === undefined && output.length >= HEAD_BYTES) {
        length = lengthFrom(output.view(), name, asked);
        // A growing buffer needs its size twice while its content is copied to a larger one.
        asked.budget.take(2 * length, name);
      }
      if (length !== undefined && output.length > length) throw wrongLength(name, length, 'more');
    }
  } finally {
    reader.cancel().catch(() => {});
  }
  if (output.length === length) return output.view();
  throw wrongLength(name, length ?? HEAD_BYTES, grouped(output.length));
}

const wrongLength = (name: string, expected: number, found: string): GaussianSplatError =>
  damaged(name, `${grouped(expected)} bytes, inflated`, found, 'decode/truncated');

const rankAt = (view: DataView, k: number): number => view.getUint32(12 + 8 * k, true);

/** Returns the inflated size of a file in bytes, from its header, and checks the header. */
function lengthFrom(head: Uint8Array, name: string, { splats, frames }: Asked): number {
  const view = viewOf(head);
  const [version, ownSplats, ownFrames] = [0, 4, 8].map((at) => view.getUint32(at, true));
  const { lives, fades } = MOTION_VERSION;
  if (version !== lives && version !== fades)
    throw damaged(name, `motion of version ${lives} or ${fades}`, `version ${version}`, 'decode/unsupported');
  if (ownSplats !== splats || ownFrames !== frames) {
    throw damaged(
      name,
      `${grouped(frames)} frames of the ${grouped(splats)} splats of the first one`,
      `${grouped(ownFrames)} of ${grouped(ownSplats)}`,
      'decode/header',
    );
  }
  return ANIMATED_ATTRIBUTE_NAMES.reduce(
    (sum, part, k) => {
      const rank = rankAt(view, k);
      if (rank > frames) throw damaged(name, `at most ${frames} curves`, `${rank} for ${part}`, 'decode/header');
      return sum + 4 * frames * rank + ANIMATED_ATTRIBUTES[part] * rank * (1 + 2 * splats);
    },
    HEAD_BYTES + 4 * splats + (version === fades ? FADE_NAMES.length * splats : 0),
  );
}

class MotionReader {
  readonly #bytes: Uint8Array;
  readonly #name: string;
  readonly #asked: Asked;
  #at = HEAD_BYTES;

  constructor(bytes: Uint8Array, name: string, asked: Asked) {
    this.#bytes = bytes;
    this.#name = name;
    this.#asked = asked;
  }

  read(): Motion {
    const { splats, frames, budget } = this.#asked;
    const view = viewOf(this.#bytes);
    const curves = ANIMATED_ATTRIBUTE_NAMES.map((_, k) => this.#curves(view, frames * rankAt(view, k)));
    const modes = this.#take(
      ANIMATED_ATTRIBUTE_NAMES.reduce((sum, part, k) => sum + ANIMATED_ATTRIBUTES[part] * rankAt(view, k), 0),
    );
    budget.take(2 * splats * modes.length, this.#name);
    const lives = this.#lives(view.getUint32(0, true) === MOTION_VERSION.fades);
    let plane = 0;
    const parts = ANIMATED_ATTRIBUTE_NAMES.map((part, k): [AnimatedAttributeName, AnimatedAttribute] => {
      const rank = rankAt(view, k);
      const step = view.getFloat32(16 + 8 * k, true);
      if (rank > 0 && !(step > 0 && step < Infinity)) throw damaged(this.#name, 'steps above 0', `${step} for ${part}`);
      const codes = Array.from({ length: ANIMATED_ATTRIBUTES[part] * rank }, () => this.#codes(modes[plane++]));
      return [part, { rank, step, curves: curves[k], codes }];
    });
    return { splats, frames, parts: Object.fromEntries(parts) as Motion['parts'], lives };
  }

  #lives(hasFades: boolean): Lives {
    const { splats, frames, budget } = this.#asked;
    budget.take((hasFades ? 8 : 4) * splats, this.#name);
    const [first, end] = [this.#words(), this.#words()];
    const fades = hasFades ? FADE_NAMES.map((name) => [name, this.#take(splats).slice()]) : undefined;
    if (first.every((begin, i) => begin < end[i] && end[i] <= frames))
      return { first, end, ...(fades && { fades: Object.fromEntries(fades) as Fades }) };
    throw damaged(this.#name, `splats that live for one of ${grouped(frames)} frames or more`, 'others');
  }

  #words(): Uint16Array {
    const { splats } = this.#asked;
    const [low, high] = [this.#take(splats), this.#take(splats)];
    return Uint16Array.from(low, (byte, i) => byte | (high[i] << 8));
  }

  #take(count: number): Uint8Array {
    return this.#bytes.subarray(this.#at, (this.#at += count));
  }

  #curves(view: DataView, count: number): Float32Array {
    const found = Float32Array.from({ length: count }, (_, i) => view.getFloat32(this.#at + 4 * i, true));
    this.#at += 4 * count;
    if (found.every((value) => Math.abs(value) <= MAX_CURVE)) return found;
    throw damaged(this.#name, 'curves of finite numbers', 'others');
  }

  #codes(mode: number): Int16Array {
    const { splats } = this.#asked;
    const [low, high] = [this.#take(splats), this.#take(splats)];
    const codes = new Int16Array(splats);
    let last = 0;
    for (let i = 0; i < splats; i++) {
      const code = low[i] | (high[i] << 8);
      const value = (code >>> 1) ^ -(code & 1);
      last = mode === MOTION_MODES.differences ? ((last + value) << 16) >> 16 : value;
      codes[i] = last;
    }
    return codes;
  }
}

/**
 * Returns the splats of a frame of the motion, as a new cloud.
 * @param first Cloud to which the motion applies; it is not modified.
 * @param frame Index of the frame in the motion, from 0.
 * @param budget Account that is charged for the new cloud.
 * @throws GaussianSplatError `decode/empty` if no splat is drawable, `out-of-memory/budget`
 */
export function applyMotion(
  first: GaussianCloud,
  { parts, lives }: Motion,
  frame: number,
  name: string,
  budget: LoadBudget,
): GaussianCloud {
  budget.takeSplats(first.count, first.shDegree, name);
  const cloud = {
    ...first,
    positions: first.positions.slice(),
    scales: first.scales.slice(),
    rotations: first.rotations.slice(),
    opacities: first.opacities.slice(),
    sh: first.sh.slice(),
  };
  const change = new Float32Array(first.count);
  const eachNumber = (part: AnimatedAttributeName, put: (number: number) => void): void => {
    const { rank, step, curves, codes } = parts[part];
    if (rank === 0) return;
    for (let number = 0; number < ANIMATED_ATTRIBUTES[part]; number++) {
      change.fill(0);
      for (let k = 0; k < rank; k++) {
        const factor = step * curves[rank * frame + k];
        const own = codes[rank * number + k];
        for (let i = 0; i < own.length; i++) change[i] += factor * own[i];
      }
      put(number);
    }
  };
  const add = (values: Float32Array, stride: number) => (number: number) => {
    for (let i = 0; i < change.length; i++) values[stride * i + number] += change[i];
  };
  eachNumber('position', add(cloud.positions, 3));
  eachNumber('scale', (number) => {
    for (let i = 0; i < change.length; i++) cloud.scales[3 * i + number] *= Math.exp(change[i]);
  });
  if (lives.fades) for (let i = 0; i < first.count; i++) cloud.opacities[i] *= fadeAt(lives.fades, lives, i, frame);
  eachNumber('opacity', add(cloud.opacities, 1));
  eachNumber('color', add(cloud.sh, 3 * shCoefficientCount(first.shDegree)));
  if (parts.rotation.rank > 0) {
    const turns = new Float32Array(3 * first.count);
    eachNumber('rotation', add(turns, 3));
    turnBy(cloud.rotations, turns);
  }
  for (let i = 0; i < first.count; i++) if (!isAlive(lives, i, frame)) hide(cloud, first, i);
  const usable = keepUsable(cloud);
  if (usable.count > 0) return usable;
  throw noSplats(name, usable);
}

const isAlive = ({ first, end }: Lives, i: number, frame: number): boolean => frame >= first[i] && frame < end[i];

/** Sets the opacity of splat `i` to 0, and restores its position, scales and rotation: curves apply only to its lifetime. */
function hide(cloud: GaussianCloud, first: GaussianCloud, i: number): void {
  cloud.opacities[i] = 0;
  cloud.positions.set(first.positions.subarray(3 * i, 3 * i + 3), 3 * i);
  cloud.scales.set(first.scales.subarray(3 * i, 3 * i + 3), 3 * i);
  cloud.rotations.set(first.rotations.subarray(4 * i, 4 * i + 4), 4 * i);
}

/** Rotates quaternions (w, x, y, z) in place by rotation vectors, [N, 3], whose length is the angle in radians. */
function turnBy(rotations: Float32Array, turns: Float32Array): void {
  for (let i = 0; i < turns.length / 3; i++) {
    const [x, y, z] = [turns[3 * i], turns[3 * i + 1], turns[3 * i + 2]];
    const angle = Math.hypot(x, y, z);
    const [c, s] = [Math.cos(angle / 2), angle > 0 ? Math.sin(angle / 2) / angle : 0.5];
    const [p, q, r] = [s * x, s * y, s * z];
    const at = 4 * i;
    const [w, a, b, d] = [rotations[at], rotations[at + 1], rotations[at + 2], rotations[at + 3]];
    rotations[at] = c * w - p * a - q * b - r * d;
    rotations[at + 1] = c * a + p * w + q * d - r * b;
    rotations[at + 2] = c * b - p * d + q * w + r * a;
    rotations[at + 3] = c * d + p * b - q * a + r * w;
  }
}
