import { halfToNumber } from '@gaussian-splat/core';
import { gunzipSync, inflateSync } from 'fflate';
import { grouped, startsWith, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import type { SceneSource } from '../scene-format.js';
import type { RadProperty } from './container.js';

/** Bytes of each value. */
const WIDTHS: Readonly<Record<string, number>> = {
  ...{ f32: 4, f16: 2, f32_lebytes: 4, f16_lebytes: 2, ln_f16: 2, u16: 2, u32: 4 },
  ...{ r8: 1, r8_delta: 1, s8: 1, s8_delta: 1, ln_0r8: 1, oct88r8: 1 },
};
/** The scale of code 0 is 0; other codes divide the logarithms between the bounds into this many steps. */
const LOGARITHM_STEPS = 254;

type Value = (at: number) => number;

/**
 * Returns the values of a property, splat by splat.
 * @param size Number of values for each splat; columns are contiguous in the file.
 * @param count Number of splats; undefined for all of them.
 */
export function valuesOf(
  property: RadProperty,
  size: number,
  count: number | undefined,
  { budget, name }: Pick<SceneSource, 'budget' | 'name'>,
): Float32Array {
  const where = `${name}, ${property.name}`;
  const width = WIDTHS[property.encoding];
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

/** Returns the bytes of a property: a copy if they are modified later. */
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

/** Palettes do not declare their length. Limit of their inflation ratio, because float32 numbers hardly compress. */
const MAX_INFLATED = 16;

/** Spark writes raw deflate streams; other writers interpret "gz" literally. */
function inflated(bytes: Uint8Array, max: number, where: string): Uint8Array {
  const out = new Uint8Array(max);
  try {
    return startsWith(bytes, [0x1f, 0x8b]) ? gunzipSync(bytes, { out }) : inflateSync(bytes, { out });
  } catch (cause) {
    // A stream that is too long ends in a RangeError.
    const expected = `a deflate stream of ${grouped(max)} bytes`;
    throw damaged(where, expected, (cause as Error).message || 'damage', 'decode/corrupt', cause);
  }
}

/** Returns a getter by index, counted column by column, for `all` values. */
function reader({ encoding, min, max }: RadProperty, bytes: Uint8Array, all: number): Value {
  const view = viewOf(bytes);
  const single = new DataView(new ArrayBuffer(4));
  /** Joins the bytes of a value that are stored plane by plane: all lowest bytes first, then the next. */
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
