import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject, parseJson, show, type JsonSource } from '../json.js';

/** Values that the lowest and the highest code of an attribute represent, one for each axis or channel. */
export interface CodeRange {
  readonly min: readonly number[];
  readonly max: readonly number[];
}

/** Ranges of the attributes that have codes. */
export interface LccRanges {
  readonly scale: CodeRange;
  readonly harmonics: CodeRange;
}

/** Description of an LCC scene: the content of its `.lcc` file. */
export interface LccMeta {
  /** Number of levels of detail; level 0 is the finest. */
  readonly levels: number;
  /** Whether the scene has spherical harmonics of degree 3. */
  readonly hasHarmonics: boolean;
  readonly ranges: LccRanges;
  /** Ranges of the splats around the scene, in `environment.bin`. */
  readonly around: LccRanges;
}

/** Splats of one level of a cell: a contiguous block of records. */
export interface LccRun {
  /** Byte offset in `data.bin` of the first record. */
  readonly start: number;
  readonly count: number;
}

/** Bytes of a splat in `data.bin`, and of its harmonics in `shcoef.bin`. `environment.bin` has both in turn. */
export const [SPLAT_BYTES, HARMONICS_BYTES] = [32, 64];
const MAX_META_BYTES = 1 << 20;
const MAX_LEVELS = 64;
/** Bytes of a cell's number, and of each of its levels, in `index.bin`. */
const [CELL_BYTES, LEVEL_BYTES] = [4, 16];
const FULL_RANGE: CodeRange = { min: [0, 0, 0], max: [1, 1, 1] };

/** @throws GaussianSplatError `decode/header`, `decode/unsupported`, or as `parseJson` does */
export function parseLccMeta(source: JsonSource): LccMeta {
  const json = parseJson(source, MAX_META_BYTES);
  const fail = (
    path: string,
    expected: string,
    found: unknown,
    code: 'decode/header' | 'decode/unsupported',
  ): never => {
    throw damaged(`${source.name}, ${path}`, expected, show(found), code);
  };
  const { totalLevel: levels, attributes, encoding = 'COMPRESS', fileType } = json;
  if (encoding !== 'COMPRESS') fail('encoding', '"COMPRESS"', encoding, 'decode/unsupported');
  if (!Number.isInteger(levels) || (levels as number) < 1 || (levels as number) > MAX_LEVELS)
    fail('totalLevel', `1 to ${MAX_LEVELS}`, levels, 'decode/header');
  const find = (name: string): unknown =>
    Array.isArray(attributes)
      ? attributes.find((attribute: unknown) => isObject(attribute) && attribute.name === name)
      : undefined;
  const rangeOf = (name: string, fallback?: CodeRange): CodeRange => {
    const found = find(name);
    if (found === undefined && fallback) return fallback;
    const { min, max } = isObject(found) ? found : {};
    const isRange = [min, max].every(
      (corner) => Array.isArray(corner) && corner.length === 3 && corner.every((value) => Number.isFinite(value)),
    );
    if (isRange) return { min: min as number[], max: max as number[] };
    return fail(`attributes, ${name}`, 'min and max of three numbers', found, 'decode/header');
  };
  // Descriptions before version 4 have no `fileType`.
  const hasHarmonics = fileType === 'Quality' || (fileType !== 'Portable' && find('shcoef') !== undefined);
  const ranges = {
    scale: rangeOf('scale'),
    harmonics: hasHarmonics ? rangeOf('shcoef') : FULL_RANGE,
  };
  const around = {
    scale: rangeOf('envscale', ranges.scale),
    harmonics: hasHarmonics ? rangeOf('envshcoef', ranges.harmonics) : FULL_RANGE,
  };
  return { levels: levels as number, hasHarmonics, ranges, around };
}

/**
 * Reads `index.bin`: for each cell its number, and for each level the number of splats (uint32), their byte offset
 * (uint64) and their size in bytes (uint32).
 * @returns The blocks of each cell by level, the finest first; blocks may be empty.
 * @throws GaussianSplatError `decode/truncated`, `decode/corrupt`
 */
export function parseLccIndex(bytes: Uint8Array, levels: number, name: string): LccRun[][] {
  const cellBytes = CELL_BYTES + LEVEL_BYTES * levels;
  if (bytes.length % cellBytes !== 0)
    throw damaged(name, `cells of ${cellBytes} bytes`, `${grouped(bytes.length)} bytes`, 'decode/truncated');
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const cells: LccRun[][] = [];
  for (let cell = 0; cell < bytes.length; cell += cellBytes) {
    const runs: LccRun[] = [];
    for (let level = 0; level < levels; level++) {
      const at = cell + CELL_BYTES + LEVEL_BYTES * level;
      const [count, start] = [view.getUint32(at, true), Number(view.getBigUint64(at + 4, true))];
      if (!Number.isSafeInteger(start)) throw damaged(name, 'offsets within a file', String(start));
      if (count > 0 && start % SPLAT_BYTES !== 0)
        throw damaged(name, `offsets that are multiples of ${SPLAT_BYTES}`, grouped(start));
      runs.push({ start, count });
    }
    cells.push(runs);
  }
  return cells;
}
