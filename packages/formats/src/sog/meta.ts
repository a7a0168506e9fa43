import { GaussianSplatError, type Credits, type ShDegree, type TrainedOrder } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { creditsOfAsset } from '../credits.js';
import { damaged, noSplatsAt } from '../faults.js';
import { trainedOrder } from '../trained-order.js';
import { failIn, isObject, parseJson, show, type FailAt, type Json, type JsonSource } from '../json.js';

/** For each channel of an image, an array with the value of each byte 0..255. */
export type ByteTable = readonly Float32Array[];

/** Content of the `meta.json` of a SOG scene, version 1 or 2. */
export interface SogMeta {
  readonly version: 1 | 2;
  readonly count: number;
  readonly antialiased: boolean;
  /**
   * Filter variance in px²: 0.1 for `model: antialiased`, which splat-transform 3 writes for PLY with `SplatRenderMode:
   * mip`; otherwise undefined.
   */
  readonly filterVariance: number | undefined;
  /** Sort order of `sortingMethod: pixel`, which the exporter of this project writes; otherwise undefined. */
  readonly order: TrainedOrder | undefined;
  readonly credits: Credits | undefined;
  /** Whether splats are 2D Gaussians (2DGS): `model: 2dgs` of splat-transform. */
  readonly isFlat: boolean;
  readonly means: {
    readonly mins: readonly number[];
    readonly maxs: readonly number[];
    readonly files: readonly string[];
  };
  /** Natural logarithms of scales, for each byte of three channels. */
  readonly scales: { readonly values: ByteTable; readonly files: readonly string[] };
  readonly quats: { readonly files: readonly string[] };
  /**
   * Constant coefficients for each byte of three channels. In version 1, a fourth table has the logits of opacities. In
   * version 2, opacities are bytes.
   */
  readonly sh0: { readonly values: ByteTable; readonly files: readonly string[] };
  readonly shN?: {
    /** Degree of spherical harmonics. Undefined if only the width of the palette's image determines it. */
    readonly degree: ShDegree | undefined;
    readonly paletteSize: number;
    readonly values: Float32Array;
    readonly files: readonly string[];
  };
}

/** Maximum size in bytes of a `meta.json`, which has a few codebooks of 256 numbers. */
export const MAX_META_BYTES = 1 << 20;
/** Maximum number of entries of a palette, because labels have 16 bits. */
const MAX_PALETTE = 65_536;

/**
 * Parses and validates the `meta.json` of a SOG scene. Version 1 does not declare its version.
 * @throws GaussianSplatError `decode/header`, `decode/unsupported`, `decode/empty`, or as `parseJson` does
 */
export function parseSogMeta(source: JsonSource): SogMeta {
  const { name } = source;
  const json = parseJson(source, MAX_META_BYTES);
  const fail: FailAt = failIn(name);
  const version = json.version ?? 1;
  if (version !== 1 && version !== 2) {
    throw damaged(`${name}, version`, 'SOG version 1 or 2', show(version), 'decode/unsupported');
  }
  const part = (key: string): Json => {
    const value = json[key];
    return isObject(value) ? value : fail(key, 'an object', value);
  };
  const numbers = (key: string, field: string, count: number): number[] => {
    const value = part(key)[field];
    const isFine = Array.isArray(value) && value.length >= count && value.every((n) => Number.isFinite(n));
    return isFine ? (value as number[]) : fail(`${key}.${field}`, `${count} numbers`, value);
  };
  const files = (key: string, count: number): string[] => {
    const value = part(key).files;
    const isFine =
      Array.isArray(value) && value.length >= count && value.every((f) => typeof f === 'string' && f !== '');
    return isFine ? (value as string[]) : fail(`${key}.files`, `${count} file names`, value);
  };
  const shape = part('means').shape;
  if (version === 1 && !part('means').files && part('means').dtype !== undefined) throw gsplatPngs(name);
  const count = version === 2 ? json.count : Array.isArray(shape) ? shape[0] : undefined;
  if (!Number.isSafeInteger(count) || (count as number) < 0) fail('count', 'the number of splats', count);
  if (count === 0) throw noSplatsAt(`${name}, count`);
  const codebook = (key: string): Float32Array => {
    const mended = withFirst(part(key).codebook);
    return tableOf(mended ?? numbers(key, 'codebook', 1));
  };
  const between = (key: string, channels: number): Float32Array[] => {
    const [mins, maxs] = [numbers(key, 'mins', channels), numbers(key, 'maxs', channels)];
    return Array.from({ length: channels }, (_, k) => ramp(mins[k], maxs[k]));
  };
  const isFirst = version === 1;
  return {
    version,
    count: count as number,
    antialiased: json.antialias === true || json.model === 'antialiased',
    filterVariance: json.model === 'antialiased' ? 0.1 : undefined,
    order: trainedOrder(json.sortingMethod),
    credits: creditsOfAsset(json.asset),
    isFlat: json.model === '2dgs',
    means: { mins: numbers('means', 'mins', 3), maxs: numbers('means', 'maxs', 3), files: files('means', 2) },
    scales: { values: isFirst ? between('scales', 3) : repeated(codebook('scales'), 3), files: files('scales', 1) },
    quats: { files: files('quats', 1) },
    sh0: { values: isFirst ? between('sh0', 4) : repeated(codebook('sh0'), 3), files: files('sh0', 1) },
    shN: json.shN === undefined || json.shN === null ? undefined : harmonics(),
  };

  function harmonics(): SogMeta['shN'] {
    const shN = part('shN');
    if (isFirst) {
      const [min, max] = [shN.mins, shN.maxs];
      if (!Number.isFinite(min) || !Number.isFinite(max)) fail('shN.mins and shN.maxs', 'a number each', [min, max]);
      const values = ramp(min as number, max as number);
      return { degree: undefined, paletteSize: MAX_PALETTE, values, files: files('shN', 2) };
    }
    // If the file does not declare the degree, the width of the texture determines it, as in PlayCanvas.
    const { bands, count: paletteSize = MAX_PALETTE } = shN;
    if (bands === 0) return undefined;
    if (bands !== undefined && bands !== 1 && bands !== 2 && bands !== 3) return fail('shN.bands', '1, 2 or 3', bands);
    if (!Number.isInteger(paletteSize) || (paletteSize as number) < 1 || (paletteSize as number) > MAX_PALETTE) {
      fail('shN.count', `1 to ${grouped(MAX_PALETTE)} entries of the palette`, paletteSize);
    }
    return { degree: bands, paletteSize: paletteSize as number, values: codebook('shN'), files: files('shN', 2) };
  }
}

/**
 * Returns a codebook of early tools, whose first entry is null, with a first entry one mean step below the second, as
 * PlayCanvas does. Undefined for all other codebooks.
 */
function withFirst(codebook: unknown): number[] | undefined {
  if (!Array.isArray(codebook) || codebook.length < 2 || codebook[0] !== null) return undefined;
  const rest = codebook.slice(1) as number[];
  if (!rest.every((value) => Number.isFinite(value))) return undefined;
  return [rest[0] - (rest[rest.length - 1] - rest[0]) / 255, ...rest];
}

/** Returns a table of 256 entries from a codebook, padded with its last entry. */
function tableOf(values: readonly number[]): Float32Array {
  return Float32Array.from({ length: 256 }, (_, byte) => values[Math.min(byte, values.length - 1)]);
}

function ramp(min: number, max: number): Float32Array {
  return Float32Array.from({ length: 256 }, (_, byte) => min + ((max - min) * byte) / 255);
}

function repeated(table: Float32Array, channels: number): Float32Array[] {
  return Array.from({ length: channels }, () => table);
}

/** Returns the error for a folder of gsplat's PNG compression, the predecessor of SOG, whose JSON names no files. */
function gsplatPngs(name: string): GaussianSplatError {
  return new GaussianSplatError('decode/unsupported', {
    where: name,
    expected: 'the meta.json of a SOG scene',
    found: "that of gsplat's PNG compression, which names no files",
    remedy: 'save the splats as PLY with the exporter of gsplat, and give that file or convert it to SOG',
  });
}
