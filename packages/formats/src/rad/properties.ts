import { halfToNumber } from '@gaussian-splat/core';
import { grouped, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import { inflateUpTo } from '../inflate.js';
import type { SceneSource } from '../scene-format.js';
import type { RadProperty } from './container.js';

/** Bytes of a value of each encoding. */
const WIDTHS: ReadonlyMap<string, number> = new Map(
  Object.entries({
    ...{ f32: 4, f16: 2, f32_lebytes: 4, f16_lebytes: 2, ln_f16: 2, u16: 2, u32: 4 },
    ...{ r8: 1, r8_delta: 1, s8: 1, s8_delta: 1, ln_0r8: 1, oct88r8: 1 },
  }),
);
/** Number of logarithmic steps between the bounds, for codes 1 to 255. Code 0 is the scale 0. */
const LOGARITHM_STEPS = 254;

type Value = (at: number) => number;

/**
 * Decodes the values of a property, [splats, size]. In the file, each of the `size` columns is contiguous.
 * @param size Number of values for each splat.
 * @param count Number of splats. If undefined, it follows from the length of the content.
 * @throws GaussianSplatError `decode/unsupported`, `decode/truncated`, `decode/corrupt`, `out-of-memory/budget`
 */
export function valuesOf(
  property: RadProperty,
  size: number,
  count: number | undefined,
  { budget, name }: Pick<SceneSource, 'budget' | 'name'>,
): Float32Array {
  const where = `${name}, ${property.name}`;
  const width = WIDTHS.get(property.encoding);
  if (width === undefined) throw damaged(where, 'a known encoding', property.encoding, 'decode/unsupported');
  const expected = count === undefined ? undefined : count * size * width;
  const bytes = contentOf(property, expected, where, budget);
  const rows = count ?? Math.floor(bytes.length / (size * width));
  budget.take(4 * rows * size, where);
  const values = new Float32Array(rows * size);
  const valueAt = reader(property, bytes, rows * size);
  const isDelta = property.encoding.endsWith('_delta');
  for (let column = 0; column < size; column++) {
    let before = 0;
    for (let row = 0; row < rows; row++) {
      const at = column * rows + row;
      if (isDelta) bytes[at] = before += bytes[at];
      values[row * size + column] = valueAt(at);
    }
  }
  return values;
}

/**
 * Decodes whole numbers of 16 or 32 bits, [count]. Float32 would round those above 2^24.
 * @throws GaussianSplatError as {@link valuesOf} does
 */
export function indicesOf(
  property: RadProperty,
  count: number,
  { budget, name }: Pick<SceneSource, 'budget' | 'name'>,
): Uint32Array {
  const where = `${name}, ${property.name}`;
  const isShort = property.encoding === 'u16';
  if (!isShort && property.encoding !== 'u32')
    throw damaged(where, 'the encoding u16 or u32', property.encoding, 'decode/unsupported');
  const view = viewOf(contentOf(property, count * (isShort ? 2 : 4), where, budget));
  budget.take(4 * count, where);
  return Uint32Array.from({ length: count }, (_, i) =>
    isShort ? view.getUint16(2 * i, true) : view.getUint32(4 * i, true),
  );
}

/**
 * Returns the inflated bytes of a property. They are a copy if decoding modifies them.
 * @param expected Number of bytes, if known. Throws `decode/truncated` for fewer.
 */
export function contentOf(
  { bytes, isDeflated, encoding }: RadProperty,
  expected: number | undefined,
  where: string,
  budget: SceneSource['budget'],
): Uint8Array {
  const max = expected ?? MAX_INFLATED * bytes.length;
  budget.take(isDeflated ? max : 0, where);
  const content = isDeflated ? inflated(bytes, max, where) : encoding.endsWith('_delta') ? bytes.slice() : bytes;
  if (expected !== undefined && content.length < expected)
    throw damaged(where, `${grouped(expected)} bytes`, grouped(content.length), 'decode/truncated');
  return content;
}

/** Maximum inflation ratio of palettes, which do not declare their length. Float32 values compress little. */
const MAX_INFLATED = 16;

/** Inflates at most `max` bytes. The compression "gz" is raw deflate in files of Spark, gzip in files of other programs. */
function inflated(bytes: Uint8Array, max: number, where: string): Uint8Array {
  try {
    return inflateUpTo(bytes, max);
  } catch (cause) {
    if (cause instanceof RangeError) throw cause;
    const expected = `a deflate stream of ${grouped(max)} bytes`;
    throw damaged(where, expected, (cause as Error).message || 'damage', 'decode/corrupt', cause);
  }
}

/** Returns a getter of a decoded value by its index, which counts column by column. @param all Number of values. */
function reader({ encoding, min, max }: RadProperty, bytes: Uint8Array, all: number): Value {
  const view = viewOf(bytes);
  const single = new DataView(new ArrayBuffer(4));
  /** Returns the bytes of a value, which are in separate planes: the lowest bytes of all values, then the next bytes. */
  const interleaved = (width: number, at: number): DataView => {
    for (let k = 0; k < width; k++) single.setUint8(k, bytes[k * all + at]);
    return single;
  };
  const signed = (at: number): number => ((bytes[at] << 24) >> 24) / 127;
  const readers: Readonly<Record<string, Value>> = {
    f32: (at) => view.getFloat32(4 * at, true),
    f16: (at) => halfToNumber(view.getUint16(2 * at, true)),
    ln_f16: (at) => Math.exp(halfToNumber(view.getUint16(2 * at, true))),
    f32_lebytes: (at) => interleaved(4, at).getFloat32(0, true),
    f16_lebytes: (at) => halfToNumber(interleaved(2, at).getUint16(0, true)),
    u16: (at) => view.getUint16(2 * at, true),
    u32: (at) => view.getUint32(4 * at, true),
    r8: (at) => min + (bytes[at] / 255) * (max - min),
    s8: (at) => signed(at) * max,
    ln_0r8: (at) => (bytes[at] === 0 ? 0 : Math.exp(min + ((bytes[at] - 1) / LOGARITHM_STEPS) * (max - min))),
  };
  return readers[encoding.replace('_delta', '')] ?? ((at) => bytes[at]);
}
