/** Unpacks the splats of a compressed PLY in WebAssembly. packages/formats/assembly/unpack-splats.ts is the code. */
import { shCoefficientCount } from '@gaussian-splat/core';
import type { DraftCloud } from '../cloud.js';
import { unpackWasm } from '../generated/unpack-splats.js';
import type { ElementData } from './rows.js';

/** Number of splats that are unpacked at once, a multiple of the 256 of a chunk. Their memory stays in the cache. */
const SLICE = 2048;
const PAGE = 65_536;

/** Functions of the code, whose comments describe their arguments. */
interface Code {
  unpack(...numbers: number[]): void;
  harmonics(...numbers: number[]): void;
}

let compiled: Promise<WebAssembly.Module | undefined> | undefined;

/** Compiles the code once. Resolves with undefined without SIMD, or if the page's policy forbids WebAssembly. */
const unpackerCode = (): Promise<WebAssembly.Module | undefined> =>
  (compiled ??= WebAssembly.compile(unpackWasm()).catch(() => undefined));

/** Elements of a compressed PLY. */
export interface PackedElements {
  readonly vertex: ElementData;
  /** The harmonics above the constant one, if the file has them. */
  readonly sh: ElementData | undefined;
  /** Bounds of each 256 splats: [chunks, 18]. */
  readonly bounds: Float32Array;
  /** Coefficient of each byte of a harmonic. */
  readonly table: Float32Array;
}

/**
 * Unpacks all splats to the arrays of a cloud.
 * @param packed Names of the four words of a splat.
 * @returns False for rows with other properties or in another order, and if WebAssembly cannot run. The arrays are then
 * unchanged.
 */
export async function unpackSplats(
  { vertex, sh, bounds, table }: PackedElements,
  packed: readonly string[],
  { count, shDegree, positions, scales, rotations, opacities, sh: harmonics }: DraftCloud,
): Promise<boolean> {
  const terms = shCoefficientCount(shDegree) - 1;
  const rest = terms > 0 ? sh : undefined;
  const stored = (rest?.element.properties.length ?? 0) / 3;
  const isUsual =
    hasRows(vertex, packed) &&
    (rest === undefined ||
      hasRows(
        rest,
        rest.element.properties.map((_, k) => `f_rest_${k}`),
      ));
  const module = isUsual ? await unpackerCode() : undefined;
  if (!module) return false;
  const chunkNumbers = 18;
  let end = 0;
  const take = (bytes: number): number => {
    const at = end;
    end += Math.ceil(bytes / 16) * 16;
    return at;
  };
  const tables = [positions, scales, rotations, opacities, harmonics].map((array) => {
    const size = array.length / count;
    return { array, size, at: take(4 * size * SLICE) };
  });
  const [words, chunks, rows, values] = [16 * SLICE, (4 * chunkNumbers * SLICE) / 256, 3 * stored * SLICE, 1024].map(
    take,
  );
  const memory = new WebAssembly.Memory({ initial: Math.ceil((end + 16) / PAGE) });
  const code = new WebAssembly.Instance(module, { env: { memory } }).exports as unknown as Code;
  const bytes = new Uint8Array(memory.buffer);
  const floats = new Float32Array(memory.buffer);
  floats.set(table, values / 4);
  const copy = ({ source, start, rowBytes = 0 }: ElementData, first: number, last: number, at: number): void =>
    bytes.set(source.bytes.subarray(start + rowBytes * first, start + rowBytes * last), at);
  const places = tables.map(({ at }) => at);
  for (let first = 0; first < count; first += SLICE) {
    const last = Math.min(count, first + SLICE);
    copy(vertex, first, last, words);
    const chunk = (chunkNumbers * first) / 256;
    floats.set(bounds.subarray(chunk, chunk + (chunkNumbers * SLICE) / 256), chunks / 4);
    code.unpack(words, chunks, last - first, ...places, 12 * (terms + 1));
    if (rest) {
      copy(rest, first, last, rows);
      code.harmonics(rows, last - first, stored, terms, values, places[4]);
    }
    for (const { array, size, at } of tables)
      array.set(floats.subarray(at / 4, at / 4 + size * (last - first)), size * first);
  }
  return true;
}

/** Whether an element has rows of only these properties in this order, in the byte order of WebAssembly. */
function hasRows({ encoding, element, rowBytes }: ElementData, names: readonly string[]): boolean {
  const { properties } = element;
  return (
    encoding === 'little-endian' &&
    rowBytes !== undefined &&
    properties.length === names.length &&
    properties.every(({ name }, k) => name === names[k])
  );
}
