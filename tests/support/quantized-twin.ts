/** Reads a chunk of quantized geometry in float64, as shaders/shared/quantized_gaussian.wgsl describes it. */
export interface QuantizedSplat {
  readonly position: readonly number[];
  /** xx, yx, yy, zx, zy, zz. */
  readonly factor: readonly number[];
  readonly opacity: number;
}

const HEAD_ROWS = 2;

const scaled = (direction: readonly number[], length: number): number[] => {
  const own = Math.hypot(...direction);
  return direction.map((x) => (x * length) / own);
};

export function readQuantizedChunk(words: Uint32Array, at: number, count: number): QuantizedSplat[] {
  const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
  const [origin, step] = [floats.subarray(at, at + 4), floats.subarray(at + 4, at + 8)];
  return Array.from({ length: count }, (_, k) => {
    const [a, b, c, d] = words.subarray(at + 4 * (HEAD_ROWS + k), at + 4 * (HEAD_ROWS + k) + 4);
    const place = [a & 0xffff, a >>> 16, b & 0xffff];
    const sizes = [c & 1023, (c >>> 10) & 1023, (c >>> 20) & 1023].map((code) => 2 ** (origin[3] + step[3] * code));
    const t = ((b >>> 29) | ((c >>> 30) << 3) | ((d >>> 25) << 5)) / 2047 - 1;
    const [u, v] = [(b >>> 16) & 0x1fff, d & 0x1fff].map((code) => code / 4095 - 1);
    const [x, y] = [(u + v) / 2, (u - v) / 2];
    const second = scaled([t, 1 - Math.abs(t)], sizes[1]);
    const third = scaled([x, y, 1 - Math.abs(x) - Math.abs(y)], sizes[2]);
    return {
      position: place.map((code, axis) => origin[axis] + step[axis] * code),
      factor: [sizes[0], ...second, ...third],
      opacity: ((d >>> 13) & 0xfff) / 1500,
    };
  });
}
