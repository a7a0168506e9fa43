/** Writes RAD as Spark's encoder does (spark-lib, rad.rs); shares no code with the reader. */
import { deflateRawSync } from 'node:zlib';
import type { GaussianCloud } from '@gaussian-splat/core';

export interface RadOptions {
  /** Splats of a chunk; Spark has 65,536. */
  readonly chunkSize?: number;
  /** Numbers of children: splats that have some are nodes of a tree. */
  readonly children?: readonly number[];
  /** Harmonics of each splat out of this many entries: those of the first splats. */
  readonly palette?: number;
  /** Chunks are files of their own, called `scene-N.radc`. */
  readonly isSplit?: boolean;
  /** Encodings without rounding. */
  readonly isExact?: boolean;
}

const SH_C0 = 0.28209479177387814;
const LOGARITHMS = { min: -12, max: 9 };
const SH_MAX = 4;

interface Property {
  readonly property: string;
  readonly encoding: string;
  readonly data: Buffer;
  readonly min?: number;
  readonly max?: number;
}

const pad = (bytes: Uint8Array): Buffer => Buffer.concat([bytes, Buffer.alloc(-bytes.length & 7)]);
const described = (magic: string, json: object): Buffer => {
  const text = Buffer.from(JSON.stringify(json));
  const start = Buffer.alloc(8, magic);
  start.writeUInt32LE(text.length, 4);
  return Buffer.concat([start, pad(text)]);
};

/** Column by column. */
function columns(
  values: ArrayLike<number>,
  size: number,
  width: number,
  put: (b: Buffer, v: number, at: number) => void,
) {
  const count = values.length / size;
  const bytes = Buffer.alloc(values.length * width);
  for (let column = 0; column < size; column++)
    for (let row = 0; row < count; row++) put(bytes, values[row * size + column], width * (column * count + row));
  return bytes;
}

const f32 = (values: ArrayLike<number>, size: number): Buffer =>
  columns(values, size, 4, (b, v, at) => b.writeFloatLE(v, at));
const codes = (values: ArrayLike<number>, size: number, code: (value: number) => number): Buffer =>
  columns(values, size, 1, (b, v, at) => b.writeUInt8(code(v) & 255, at));
const clamp = (value: number, low: number, high: number): number => Math.min(high, Math.max(low, Math.round(value)));

/** The lowest byte of each value, then the next ones. */
function bytePlanes(values: ArrayLike<number>, size: number): Buffer {
  const plain = f32(values, size);
  return Buffer.from(plain.map((_, k) => plain[4 * (k % values.length) + Math.floor(k / values.length)]));
}

/** Differences from the value before in the same column. */
function delta(bytes: Buffer, count: number): Buffer {
  return Buffer.from(bytes.map((byte, k) => (k % count === 0 ? byte : byte - bytes[k - 1])));
}

function octahedral([w, x, y, z]: readonly number[]): number[] {
  const sign = w < 0 ? -1 : 1;
  const theta = 2 * Math.acos(Math.min(1, Math.abs(w)));
  const sum = (Math.abs(x) + Math.abs(y) + Math.abs(z)) * sign || 1;
  let [u, v] = [x / sum, y / sum];
  if (z * sign < 0) [u, v] = [(1 - Math.abs(v)) * (u >= 0 ? 1 : -1), (1 - Math.abs(u)) * (v >= 0 ? 1 : -1)];
  return [clamp(127.5 * (u + 1), 0, 255), clamp(127.5 * (v + 1), 0, 255), clamp((255 * theta) / Math.PI, 0, 255)];
}

/** The files of a scene by name; `scene.rad` is the one to open. */
export function writeRad(cloud: GaussianCloud, options: RadOptions = {}): Record<string, Buffer> {
  const { chunkSize = 65_536, children, palette, isSplit } = options;
  const files: Record<string, Buffer> = {};
  const chunks: { offset: number; bytes: number; filename?: string }[] = [];
  const bodies: Buffer[] = [];
  let offset = 0;
  for (let base = 0; base < cloud.count; base += chunkSize) {
    const chunk = writeChunk(cloud, base, Math.min(chunkSize, cloud.count - base), options);
    const filename = `scene-${chunks.length}.radc`;
    chunks.push({ offset: isSplit ? 0 : offset, bytes: chunk.length, ...(isSplit ? { filename } : {}) });
    offset += chunk.length;
    if (isSplit) files[filename] = chunk;
    else bodies.push(chunk);
  }
  const meta = {
    ...{ version: 1, type: 'gsplat', count: cloud.count, maxSh: cloud.shDegree, chunkSize },
    ...(children ? { lodTree: true } : {}),
    ...(palette ? { shCodeCount: palette } : {}),
    ...{ allChunkBytes: offset, chunks },
  };
  return { ...files, 'scene.rad': Buffer.concat([described('RAD0', meta), ...bodies]) };
}

function writeChunk(cloud: GaussianCloud, base: number, count: number, options: RadOptions): Buffer {
  const { children, palette, isExact } = options;
  const { shDegree } = cloud;
  const stride = 3 * (shDegree + 1) ** 2;
  const rows = (values: Float32Array, size: number): Float32Array =>
    values.subarray(size * base, size * (base + count));
  const harmonics = (from: number, first: number, size: number, all: number): number[] =>
    Array.from({ length: all * size }, (_, k) => cloud.sh[stride * (from + Math.floor(k / size)) + first + (k % size)]);
  const colors = harmonics(base, 0, 3, count).map((value) => 0.5 + SH_C0 * value);
  const rotations = rows(cloud.rotations, 4);
  const quaternions = Array.from({ length: count }, (_, i) => [...rotations.subarray(4 * i, 4 * i + 4)]);
  const maxAlpha = children ? 2 : 1;
  const { min, max } = LOGARITHMS;
  const shProperty = (property: string, values: readonly number[], size: number): Property =>
    isExact
      ? { property, encoding: 'f32', data: f32(values, size) }
      : {
          ...{ property, encoding: 's8', min: -SH_MAX, max: SH_MAX },
          data: codes(values, size, (v) => clamp((127 * v) / SH_MAX, -127, 127)),
        };
  const properties: Property[] = isExact
    ? [
        { property: 'center', encoding: 'f32', data: f32(rows(cloud.positions, 3), 3) },
        { property: 'alpha', encoding: 'f32', data: f32(rows(cloud.opacities, 1), 1) },
        { property: 'rgb', encoding: 'f32', data: f32(colors, 3) },
        { property: 'scales', encoding: 'f32', data: f32(rows(cloud.scales, 3), 3) },
        {
          ...{ property: 'orientation', encoding: 'f32' },
          data: f32(
            quaternions.flatMap(([w, ...xyz]) => xyz.map((value) => (w < 0 ? -value : value))),
            3,
          ),
        },
      ]
    : [
        { property: 'center', encoding: 'f32_lebytes', data: bytePlanes(rows(cloud.positions, 3), 3) },
        {
          ...{ property: 'alpha', encoding: 'r8', min: 0, max: maxAlpha },
          data: codes(rows(cloud.opacities, 1), 1, (v) => clamp((255 * v) / maxAlpha, 0, 255)),
        },
        {
          ...{ property: 'rgb', encoding: 'r8_delta', min: -0.5, max: 1.5 },
          data: delta(
            codes(colors, 3, (v) => clamp(127.5 * (v + 0.5), 0, 255)),
            count,
          ),
        },
        {
          ...{ property: 'scales', encoding: 'ln_0r8', min, max },
          data: codes(rows(cloud.scales, 3), 3, (v) =>
            v > 0 ? 1 + clamp((254 * (Math.log(v) - min)) / (max - min), 0, 254) : 0,
          ),
        },
        { property: 'orientation', encoding: 'oct88r8', data: Buffer.from(quaternions.flatMap(octahedral)) },
      ];
  for (let band = 1; band <= shDegree; band++) {
    const [size, first] = [3 * (2 * band + 1), 3 * band * band];
    if (!palette) properties.push(shProperty(`sh${band}`, harmonics(base, first, size, count), size));
    else if (base === 0) properties.push(shProperty(`sh${band}_code`, harmonics(0, first, size, palette), size));
  }
  if (palette && shDegree > 0) {
    const labels = Array.from({ length: count }, (_, i) => (base + i) % palette);
    properties.push({
      property: 'sh_label',
      encoding: 'u16',
      data: columns(labels, 1, 2, (b, v, at) => b.writeUInt16LE(v, at)),
    });
  }
  if (children) {
    const own = children.slice(base, base + count);
    properties.push({
      property: 'child_count',
      encoding: 'u16',
      data: columns(own, 1, 2, (b, v, at) => b.writeUInt16LE(v, at)),
    });
    properties.push({ property: 'child_start', encoding: 'u32', data: Buffer.alloc(4 * count) });
  }
  const deflated = properties.map(({ data }) => deflateRawSync(data));
  let offset = 0;
  const listed = properties.map(({ property, encoding, min, max }, k) => {
    const own = { offset, bytes: deflated[k].length, property, encoding, compression: 'gz', min, max };
    offset += pad(deflated[k]).length;
    return own;
  });
  const meta = {
    version: 1,
    base,
    count,
    payloadBytes: offset,
    maxSh: shDegree,
    ...(children ? { lodTree: true } : {}),
    properties: listed,
  };
  const payload = Buffer.alloc(8);
  payload.writeUInt32LE(offset);
  return Buffer.concat([described('RADC', meta), payload, ...deflated.map(pad)]);
}
