/** Damage of files: a few bytes, words, digits or stretches. */
import type { Random } from '../../support/random.js';

/** Numbers that headers do not expect. */
const EXTREMES = [0, 1, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x7fffffff, 0x80000000, 0xffffffff];

/** A file with a few bytes, words, digits or stretches changed. */
export function damage(file: Uint8Array, random: Random): Uint8Array {
  let bytes: Uint8Array = Uint8Array.from(file);
  const below = (n: number): number => Math.floor(random.uniform(0, n));
  for (let changes = 1 + below(4); changes > 0 && bytes.length > 0; changes--) {
    // Half of the changes go to the first bytes, which hold the counts.
    const at = below(random.uniform(0, 1) < 0.5 ? Math.min(bytes.length, 256) : bytes.length);
    switch (below(7)) {
      case 0:
        bytes[at] = below(256);
        break;
      case 1:
        bytes[at] ^= 1 << below(8);
        break;
      case 2:
        if (at + 4 <= bytes.length) new DataView(bytes.buffer).setUint32(at, EXTREMES[below(EXTREMES.length)], true);
        break;
      case 3:
        bytes = bytes.slice(0, at);
        break;
      case 4:
        bytes.copyWithin(at, below(bytes.length), below(bytes.length));
        break;
      case 5:
        bytes.fill(below(2) * 255, at, at + below(40));
        break;
      default: {
        // Texts: another digit, and a longer number.
        const text = Buffer.from(bytes).toString('latin1');
        const digit = text.slice(at, at + 400).search(/\d/);
        if (digit >= 0) {
          const number = ['9', '0', '99999999999', '-1', '1e99'][below(5)];
          bytes = new Uint8Array(
            Buffer.from(text.slice(0, at + digit) + number + text.slice(at + digit + 1), 'latin1'),
          );
        }
      }
    }
  }
  return bytes;
}
