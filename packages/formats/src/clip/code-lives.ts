/** Model of the lifetimes and fades of splats for the range coder. */
import { FADE_NAMES, type Lives } from '../motion.js';
import { Contexts, type BitCoder } from './range-coder.js';

/** Codes whole numbers of some bits, the highest first; the higher bits are the context of a bit. */
class TreeModel {
  readonly #bits: number;
  readonly #contexts: Contexts;

  constructor(bits: number, kinds: number) {
    this.#bits = bits;
    this.#contexts = new Contexts(kinds * 2 ** bits);
  }

  code(coder: BitCoder, value: number, kind: number): number {
    let node = 1;
    for (let k = this.#bits - 1; k >= 0; k--)
      node = 2 * node + coder.bit(this.#contexts, kind * 2 ** this.#bits + node, (value >>> k) & 1);
    return node - 2 ** this.#bits;
  }
}

/** Number of classes of an end of a fade, for its slope. */
const ENDS = 8;

/**
 * Codes lifetimes and fades. A decoder fills the arrays, with 0 <= first < end <= frames.
 * @param frames 1 to 4096.
 */
export function codeLives(coder: BitCoder, { first, end, fades }: Lives, frames: number): void {
  const bits = Math.max(1, Math.ceil(Math.log2(frames + 1)));
  const whole = new Contexts(2);
  const [begins, lengths] = [new TreeModel(bits, 1), new TreeModel(bits, 2)];
  const [ends, slopes] = [new TreeModel(8, 4), new TreeModel(8, 4 * ENDS)];
  let before = 0;
  for (let i = 0; i < first.length; i++) {
    const isPassing = coder.bit(whole, before, first[i] > 0 || end[i] < frames ? 1 : 0);
    before = isPassing;
    if (isPassing === 0) [first[i], end[i]] = [0, frames];
    else {
      first[i] = Math.min(frames - 1, begins.code(coder, first[i], 0));
      const length = lengths.code(coder, end[i] - first[i], first[i] === 0 ? 1 : 0);
      end[i] = Math.min(frames, first[i] + Math.max(1, length));
    }
    if (!fades) continue;
    // Fades at the ends of the group are rare.
    for (let k = 0; k < FADE_NAMES.length; k += 2) {
      const [place, slope] = [fades[FADE_NAMES[k]], fades[FADE_NAMES[k + 1]]];
      const kind = k + (k === 0 ? Number(first[i] === 0) : Number(end[i] === frames));
      place[i] = ends.code(coder, place[i], kind);
      slope[i] = slopes.code(
        coder,
        slope[i],
        ENDS * kind + (place[i] === 255 ? 0 : 1 + ((place[i] * (ENDS - 1)) >> 8)),
      );
    }
  }
}
