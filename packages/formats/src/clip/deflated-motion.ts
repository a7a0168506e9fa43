/** Reader of motion of versions 2 and 3, which clips of version 1 have: deflated planes of bytes. */
import type { GaussianSplatError } from '@gaussian-splat/core';
import { GrowingBytes, grouped, viewOf } from '../bytes.js';
import { decompressing } from '../decompression.js';
import { damaged } from '../faults.js';
import {
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  FADE_NAMES,
  MAX_CURVE,
  type AnimatedAttribute,
  type AnimatedAttributeName,
  type Fades,
  type Lives,
  type Motion,
} from '../motion.js';
import type { MotionFile } from './read-motion.js';

/** Versions of files. `lives`: splats have lifetimes. `fades`: they fade, too. */
const MOTION_VERSION = { lives: 2, fades: 3 } as const;
/** Size of the header: version, splats, frames, and a rank and a step for each of {@link ANIMATED_ATTRIBUTES}. */
const HEAD_BYTES = 4 * (3 + 2 * ANIMATED_ATTRIBUTE_NAMES.length);
/** Coding of a plane of codes: plain codes, or differences from the code of the previous splat. */
const MOTION_MODES = { plain: 0, differences: 1 } as const;

interface Asked extends Pick<MotionFile, 'frames' | 'budget'> {
  readonly splats: number;
}

/** Reads motion of version 2 or 3. Throws as `readMotion` does. */
export async function readDeflatedMotion(bytes: Uint8Array, name: string, asked: Asked): Promise<Motion> {
  return new MotionReader(await inflate(bytes, name, asked), name, asked).read();
}

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
      return [part, { rank, aged: 0, step, curves: curves[k], codes }];
    });
    return { splats, frames, parts: Object.fromEntries(parts) as Motion['parts'], lives, turnsHarmonics: false };
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
