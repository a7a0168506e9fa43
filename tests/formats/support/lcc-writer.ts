/** A writer of LCC, after the public tools ply2lcc and splat-transform. It shares no code with the reader. */
import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';

const SH_C0 = 0.28209479177387814;

export interface LccOptions {
  /** Number of splats in each cell; default all in one. */
  readonly cellSize?: number;
  /** Number of cells, each with the same part of every level; instead of `cellSize`. */
  readonly cellCount?: number;
  /** Splats around the scene, for `environment.bin`. */
  readonly environment?: GaussianCloud;
  /** Changes of the description. */
  readonly meta?: Readonly<Record<string, unknown>>;
}

interface Limits {
  readonly min: readonly number[];
  readonly max: readonly number[];
}

/** Lowest and highest value of each of three channels. */
function limitsOf(values: Float32Array, isOwn: (index: number) => boolean = () => true): Limits {
  const [min, max] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  values.forEach((value, index) => {
    if (!isOwn(index)) return;
    min[index % 3] = Math.min(min[index % 3], value);
    max[index % 3] = Math.max(max[index % 3], value);
  });
  return { min, max };
}

const scalesOf = (clouds: readonly GaussianCloud[]): Limits =>
  limitsOf(Float32Array.from(clouds.flatMap(({ scales }) => [...scales])));

/** Limits of the coefficients above the constant one. */
function harmonicsOf(clouds: readonly GaussianCloud[]): Limits {
  const [{ shDegree }] = clouds;
  const width = 3 * shCoefficientCount(shDegree);
  return limitsOf(Float32Array.from(clouds.flatMap(({ sh }) => [...sh])), (index) => index % width > 2);
}

const codeOf = (value: number, { min, max }: Limits, k: number, top: number): number =>
  Math.round((max[k] > min[k] ? (value - min[k]) / (max[k] - min[k]) : 0) * top);

function splatRecord(cloud: GaussianCloud, i: number, limits: Limits): Uint8Array {
  const record = new DataView(new ArrayBuffer(32));
  const width = 3 * shCoefficientCount(cloud.shDegree);
  for (let k = 0; k < 3; k++) {
    record.setFloat32(4 * k, cloud.positions[3 * i + k], true);
    const color = 0.5 + SH_C0 * cloud.sh[width * i + k];
    record.setUint8(12 + k, Math.round(255 * Math.min(1, Math.max(0, color))));
    record.setUint16(16 + 2 * k, codeOf(cloud.scales[3 * i + k], limits, k, 65_535), true);
  }
  record.setUint8(15, Math.round(255 * cloud.opacities[i]));
  const [w, x, y, z] = cloud.rotations.subarray(4 * i, 4 * i + 4);
  const quaternion = [x, y, z, w];
  const sizes = quaternion.map(Math.abs);
  const largest = sizes.indexOf(Math.max(...sizes));
  const sign = Math.sign(quaternion[largest]);
  const rest = quaternion.filter((_, k) => k !== largest).map((value) => sign * value);
  const codes = rest.map((value) => Math.round(((value + Math.SQRT1_2) / Math.SQRT2) * 1023));
  record.setUint32(22, (codes[0] | (codes[1] << 10) | (codes[2] << 20) | (largest << 30)) >>> 0, true);
  return new Uint8Array(record.buffer);
}

function harmonicsRecord({ sh, shDegree }: GaussianCloud, i: number, limits: Limits): Uint8Array {
  const record = new DataView(new ArrayBuffer(64));
  const count = shCoefficientCount(shDegree);
  for (let c = 0; c < 15; c++) {
    const of = (k: number): number => (c + 1 < count ? sh[3 * (count * i + c + 1) + k] : 0);
    const [red, green, blue] = [2047, 1023, 2047].map((top, k) => codeOf(of(k), limits, k, top));
    record.setUint32(4 * c, (red | (green << 11) | (blue << 21)) >>> 0, true);
  }
  return new Uint8Array(record.buffer);
}

/** Joins parts, also in pages. */
function joined(parts: readonly Uint8Array[]): Uint8Array {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

/**
 * Files of a scene by their paths.
 * @param levels Clouds of degree 3 or 0, the finest first, with z up.
 */
export function writeLcc(levels: readonly GaussianCloud[], options: LccOptions = {}): Record<string, Uint8Array> {
  const { cellSize = Infinity, cellCount, environment, meta } = options;
  const hasHarmonics = levels[0].shDegree > 0;
  const scale = scalesOf(levels);
  const shcoef = hasHarmonics ? harmonicsOf(levels) : { min: [0, 0, 0], max: [1, 1, 1] };
  const around = environment ? [environment] : levels;
  const envscale = scalesOf(around);
  const envshcoef = hasHarmonics ? harmonicsOf(around) : shcoef;
  const cells = cellCount ?? Math.max(1, ...levels.map(({ count }) => Math.ceil(count / cellSize)));
  const [data, harmonics]: [Uint8Array[], Uint8Array[]] = [[], []];
  const index = new DataView(new ArrayBuffer(cells * (4 + 16 * levels.length)));
  let at = 0;
  for (let cell = 0; cell < cells; cell++) {
    index.setUint16(at, cell, true);
    at += 4;
    for (const cloud of levels) {
      const size = cellCount === undefined ? cellSize : Math.ceil(cloud.count / cellCount);
      const first = cell === 0 ? 0 : Math.min(cloud.count, cell * size);
      const end = Math.max(first, Math.min(cloud.count, cell === cells - 1 ? cloud.count : first + size));
      index.setUint32(at, end - first, true);
      index.setBigUint64(at + 4, BigInt(32 * data.length), true);
      index.setUint32(at + 12, 32 * (end - first), true);
      at += 16;
      for (let i = first; i < end; i++) {
        data.push(splatRecord(cloud, i, scale));
        if (hasHarmonics) harmonics.push(harmonicsRecord(cloud, i, shcoef));
      }
    }
  }
  const description = {
    ...{ version: '5.0', name: 'a scene', encoding: 'COMPRESS', fileType: hasHarmonics ? 'Quality' : 'Portable' },
    ...{ totalSplats: data.length, totalLevel: levels.length, splats: levels.map(({ count }) => count) },
    ...{ cellLengthX: 30, cellLengthY: 30, indexDataSize: 4 + 16 * levels.length },
    attributes: Object.entries({ scale, shcoef, envscale, envshcoef }).map(([name, limits]) => ({ name, ...limits })),
    ...meta,
  };
  const records = Array.from({ length: environment?.count ?? 0 }, (_, i) => [
    splatRecord(environment!, i, envscale),
    ...(hasHarmonics ? [harmonicsRecord(environment!, i, envshcoef)] : []),
  ]);
  return {
    'meta.lcc': new TextEncoder().encode(JSON.stringify(description)),
    'index.bin': new Uint8Array(index.buffer),
    'data.bin': joined(data),
    ...(hasHarmonics && { 'shcoef.bin': joined(harmonics) }),
    ...(environment && { 'environment.bin': joined(records.flat()) }),
  };
}
