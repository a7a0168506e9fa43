/** Writes RAD with a tree of levels, after Spark's rad.rs. It shares no code with the readers, and runs in pages. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { pick } from './lod-folder.js';

export interface RadTreeOptions {
  /** Splats of a chunk; Spark has 65,536. */
  readonly chunkSize: number;
  /** Whether the splats above the leaves are left out, so that there are no levels. */
  readonly isFlat?: boolean;
}

const SH_C0 = 0.28209479177387814;
/** Children of a splat. */
const CHILDREN = 4;

/** Indices of splats in an order whose runs of 4, 16, 64 and so on are neighbors, if the number is a power of 4. */
function neighbors(positions: Float32Array, own: readonly number[], axis = 0): readonly number[] {
  if (own.length <= 1) return own;
  const sorted = own.toSorted((a, b) => positions[3 * a + axis] - positions[3 * b + axis]);
  const middle = sorted.length >> 1;
  const next = (axis + 1) % 3;
  return [...neighbors(positions, sorted.slice(0, middle), next), ...neighbors(positions, sorted.slice(middle), next)];
}

interface Tree {
  readonly cloud: GaussianCloud;
  readonly counts: readonly number[];
  readonly starts: readonly number[];
}

/** The root, its children, and so on. A splat has the place of one of its children, and twice its size. */
function treeOf(cloud: GaussianCloud): Tree {
  const levels = [neighbors(cloud.positions, [...Array(cloud.count).keys()])];
  while (levels[0].length > 1) levels.unshift(levels[0].filter((_, k) => k % CHILDREN === 0));
  const [counts, starts]: [number[], number[]] = [[], []];
  let below = 0;
  levels.forEach((level, depth) => {
    below += level.length;
    const next = depth + 1 < levels.length ? levels[depth + 1].length : 0;
    level.forEach((_, k) => {
      counts.push(Math.max(0, Math.min(CHILDREN, next - CHILDREN * k)));
      starts.push(next > 0 ? below + CHILDREN * k : 0);
    });
  });
  const parts = levels.map((level, depth) => pick(cloud, level, 2 ** (levels.length - 1 - depth)));
  const joined = (key: 'positions' | 'scales' | 'rotations' | 'opacities' | 'sh'): Float32Array =>
    Float32Array.from(parts.flatMap((part) => [...part[key]]));
  const arrays = { positions: joined('positions'), scales: joined('scales'), rotations: joined('rotations') };
  return {
    cloud: { ...cloud, ...arrays, opacities: joined('opacities'), sh: joined('sh'), count: counts.length },
    ...{ counts, starts },
  };
}

function joined(parts: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
  return all;
}

const padded = (bytes: Uint8Array): Uint8Array => joined([bytes, new Uint8Array(-bytes.length & 7)]);

function described(magic: string, json: object): Uint8Array {
  const text = new TextEncoder().encode(JSON.stringify(json));
  const length = new Uint8Array(Uint32Array.of(text.length).buffer);
  return joined([new TextEncoder().encode(magic), length, padded(text)]);
}

/** The bytes of a scene's file. Values are float32, without compression. */
export function writeRadTree(scene: GaussianCloud, { chunkSize, isFlat = false }: RadTreeOptions): Uint8Array {
  const zeros = Array<number>(scene.count).fill(0);
  const { cloud, counts, starts } = isFlat ? { cloud: scene, counts: zeros, starts: zeros } : treeOf(scene);
  const chunks: Uint8Array[] = [];
  for (let base = 0; base < cloud.count; base += chunkSize)
    chunks.push(chunkOf({ cloud, counts, starts }, base, Math.min(chunkSize, cloud.count - base), isFlat));
  let at = 0;
  const listed = chunks.map(({ length }) => ({ offset: (at += length) - length, bytes: length }));
  const head = { version: 1, type: 'gsplat', count: cloud.count, maxSh: cloud.shDegree, chunkSize };
  return joined([
    described('RAD0', { ...head, ...(!isFlat && { lodTree: true }), allChunkBytes: at, chunks: listed }),
    ...chunks,
  ]);
}

function chunkOf({ cloud, counts, starts }: Tree, base: number, count: number, isFlat: boolean): Uint8Array {
  const stride = 3 * (cloud.shDegree + 1) ** 2;
  /** Values of a property, column by column. */
  const floats = (size: number, at: (i: number, k: number) => number): Float32Array =>
    Float32Array.from({ length: size * count }, (_, n) => at(base + (n % count), Math.floor(n / count)));
  const signOf = (i: number): number => (cloud.rotations[4 * i] < 0 ? -1 : 1);
  const properties: [string, string, ArrayBufferView][] = [
    ['center', 'f32', floats(3, (i, k) => cloud.positions[3 * i + k])],
    ['alpha', 'f32', floats(1, (i) => cloud.opacities[i])],
    ['rgb', 'f32', floats(3, (i, k) => 0.5 + SH_C0 * cloud.sh[stride * i + k])],
    ['scales', 'f32', floats(3, (i, k) => cloud.scales[3 * i + k])],
    ['orientation', 'f32', floats(3, (i, k) => signOf(i) * cloud.rotations[4 * i + k + 1])],
  ];
  for (let band = 1; band <= cloud.shDegree; band++)
    properties.push([
      `sh${band}`,
      'f32',
      floats(3 * (2 * band + 1), (i, k) => cloud.sh[stride * i + 3 * band * band + k]),
    ]);
  if (!isFlat) {
    properties.push(['child_count', 'u16', Uint16Array.from(counts.slice(base, base + count))]);
    properties.push(['child_start', 'u32', Uint32Array.from(starts.slice(base, base + count))]);
  }
  const parts = properties.map(([, , { buffer }]) => padded(new Uint8Array(buffer as ArrayBuffer)));
  let offset = 0;
  const listed = properties.map(([property, encoding, { byteLength: bytes }], k) => ({
    ...{ offset: (offset += parts[k].length) - parts[k].length, bytes, property, encoding },
  }));
  const head = { version: 1, base, count, payloadBytes: offset, maxSh: cloud.shDegree, properties: listed };
  const length = new Uint8Array(8);
  new DataView(length.buffer).setUint32(0, offset, true);
  return joined([described('RADC', isFlat ? head : { ...head, lodTree: true }), length, ...parts]);
}
