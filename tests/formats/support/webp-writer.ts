/** Writes lossless WebP images in the plainest way there is: every byte of every pixel as eight bits. */

class BitWriter {
  readonly bytes: number[] = [];
  #bits = 0;
  #count = 0;

  write(value: number, count: number): void {
    for (let bit = 0; bit < count; bit++) {
      this.#bits |= ((value >>> bit) & 1) << this.#count;
      if (++this.#count < 8) continue;
      this.bytes.push(this.#bits);
      [this.#bits, this.#count] = [0, 0];
    }
  }

  finish(): Uint8Array {
    if (this.#count > 0) this.bytes.push(this.#bits);
    return Uint8Array.from(this.bytes);
  }
}

/** The position of length 8 in the storage order of code lengths, and how many are stored up to it. */
const STORED_LENGTHS = 12;

/** A code with eight bits for each of the symbols 0 to 255. */
function writeFlatCode(bits: BitWriter): void {
  bits.write(0, 1);
  bits.write(STORED_LENGTHS - 4, 4);
  for (let k = 0; k < STORED_LENGTHS; k++) bits.write(k === STORED_LENGTHS - 1 ? 1 : 0, 3);
  // 256 lengths follow, of a code with one symbol: they take no bits.
  bits.write(1, 1);
  bits.write(3, 3);
  bits.write(256 - 2, 8);
}

/** A code of one symbol, 0. */
function writeEmptyCode(bits: BitWriter): void {
  bits.write(1, 1);
  bits.write(0, 1);
  bits.write(0, 1);
  bits.write(0, 1);
}

const reversed = (byte: number): number => {
  let result = 0;
  for (let bit = 0; bit < 8; bit++) result |= ((byte >>> bit) & 1) << (7 - bit);
  return result;
};

/** @param rgba [height, width, 4] bytes. */
export function writeWebp(rgba: Uint8Array, width: number, height: number): Uint8Array {
  const bits = new BitWriter();
  bits.write(0x2f, 8);
  bits.write(width - 1, 14);
  bits.write(height - 1, 14);
  bits.write(1, 1);
  bits.write(0, 3);
  // No transform, no color cache, one group of codes.
  bits.write(0, 3);
  for (let code = 0; code < 4; code++) writeFlatCode(bits);
  writeEmptyCode(bits);
  for (let i = 0; i < 4 * width * height; i += 4) {
    for (const channel of [1, 0, 2, 3]) bits.write(reversed(rgba[i + channel]), 8);
  }
  const stream = bits.finish();
  const length = stream.length + (stream.length & 1);
  const file = new Uint8Array(20 + length);
  file.set(new TextEncoder().encode('RIFF\0\0\0\0WEBPVP8L'));
  const view = new DataView(file.buffer);
  view.setUint32(4, 12 + length, true);
  view.setUint32(16, stream.length, true);
  file.set(stream, 20);
  return file;
}
