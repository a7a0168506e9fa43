/** Writes 3D Tiles of splats with levels, after OGC 22-025 and KHR_gaussian_splatting. It shares no code with the readers, and runs in pages. */
import type { GaussianCloud } from '@gaussian-splat/core';
import { pick } from './lod-folder.js';

export interface TilesetOptions {
  /** Levels of tiles; a tile has four below it. The finest ones have all splats, each coarser one a quarter. */
  readonly levels: number;
  /** Transform of the root, a column-major matrix of 16 numbers. */
  readonly transform?: readonly number[];
  /** Whether tiles are listed by subtrees of two levels each, instead of one by one. */
  readonly isImplicit?: boolean;
  /** Depth of tiles that are in a tileset of their own; default: none. */
  readonly nestedAt?: number;
  /** Whether the tiles above the finest ones have no splats. */
  readonly isHollow?: boolean;
}

export type TilesetFiles = ReadonlyMap<string, Uint8Array>;

const json = (value: unknown): Uint8Array => new TextEncoder().encode(JSON.stringify(value));

function joined(parts: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

const padded = (bytes: Uint8Array, filler: number): Uint8Array =>
  joined([bytes, new Uint8Array(-bytes.length & 3).fill(filler)]);

const words = (...values: readonly number[]): Uint8Array => new Uint8Array(Uint32Array.from(values).buffer);

/** A GLB of a cloud in the frame of glTF, with its harmonics. */
export function splatGlb({ count, positions, scales, rotations, opacities, sh, shDegree }: GaussianCloud): Uint8Array {
  const views: Uint8Array[] = [];
  const accessors: object[] = [];
  let at = 0;
  const accessor = (values: Float32Array, width: number): number => {
    const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    views.push(bytes);
    at += bytes.length;
    const type = width === 1 ? 'SCALAR' : `VEC${width}`;
    return accessors.push({ bufferView: views.length - 1, componentType: 5126, count, type }) - 1;
  };
  const name = 'KHR_gaussian_splatting';
  const attributes: Record<string, number> = {
    POSITION: accessor(positions.slice(0, 3 * count), 3),
    [`${name}:SCALE`]: accessor(scales.slice(0, 3 * count), 3),
    [`${name}:ROTATION`]: accessor(
      Float32Array.from({ length: 4 * count }, (_, k) => rotations[4 * (k >> 2) + ((k + 1) & 3)]),
      4,
    ),
    [`${name}:OPACITY`]: accessor(opacities.slice(0, count), 1),
  };
  const stride = 3 * (shDegree + 1) ** 2;
  for (let degree = 0, k = 0; degree <= shDegree; degree++) {
    for (let c = 0; c <= 2 * degree; c++, k++) {
      const column = Float32Array.from(
        { length: 3 * count },
        (_, n) => sh[stride * Math.floor(n / 3) + 3 * k + (n % 3)],
      );
      attributes[`${name}:SH_DEGREE_${degree}_COEF_${c}`] = accessor(column, 3);
    }
  }
  let from = 0;
  const bufferViews = views.map(({ length }) => ({
    buffer: 0,
    byteOffset: (from += length) - length,
    byteLength: length,
  }));
  const extensions = { [name]: { kernel: 'ellipse', colorSpace: 'srgb_rec709_display' } };
  const text = padded(
    json({
      ...{
        asset: { version: '2.0' },
        extensionsUsed: [name],
        scene: 0,
        scenes: [{ nodes: [0] }],
        nodes: [{ mesh: 0 }],
      },
      ...{ meshes: [{ primitives: [{ mode: 0, attributes, extensions }] }], accessors, bufferViews },
      buffers: [{ byteLength: at }],
    }),
    0x20,
  );
  const binary = joined(views);
  const head = words(0x46546c67, 2, 28 + text.length + binary.length, text.length, 0x4e4f534a);
  return joined([head, text, words(binary.length, 0x004e4942), binary]);
}

interface Square {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  /** Indices of its splats, of all levels below it. */
  readonly own: readonly number[];
}

/**
 * Divides a cloud in the frame of glTF (y up) into a quadtree of tiles over the ground. The files are those beside
 * `tileset.json`, which is one of them.
 */
export function splatTileset(cloud: GaussianCloud, options: TilesetOptions): TilesetFiles {
  const { levels, transform, isImplicit, nestedAt, isHollow } = options;
  const { positions, count } = cloud;
  const files = new Map<string, Uint8Array>();
  const side = (axis: number, sign = 1): readonly [number, number] => {
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < count; i++) {
      const value = sign * positions[3 * i + axis];
      [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
    return [low, high];
  };
  // East, north, up of a tile are x, -z, y of its glTF.
  const sides = [side(0), side(2, -1), side(1)];
  const boxAt = ({ level, x, y }: Pick<Square, 'level' | 'x' | 'y'>): number[] => {
    const half = sides.map(([low, high], axis) => (high - low) / 2 / (axis < 2 ? 2 ** level : 1));
    const center = sides.map(([low], axis) => low + half[axis] * (axis < 2 ? 2 * [x, y][axis] + 1 : 1));
    return [...center, half[0], 0, 0, 0, half[1], 0, 0, 0, half[2]];
  };
  const errorAt = (level: number): number => (level === levels - 1 ? 0 : (sides[0][1] - sides[0][0]) / 16 / 2 ** level);
  const below = ({ level, x, y, own }: Square): Square[] => {
    const [cx, cy] = boxAt({ level, x, y });
    const quarter = (i: number): number => (positions[3 * i] > cx ? 1 : 0) + (-positions[3 * i + 2] > cy ? 2 : 0);
    return [0, 1, 2, 3].map((k) => ({
      ...{ level: level + 1, x: 2 * x + (k & 1), y: 2 * y + (k >> 1) },
      own: own.filter((i) => quarter(i) === k),
    }));
  };
  const nameOf = ({ level, x, y }: Square): string => `${level}/${x}-${y}.glb`;
  const tileOf = (square: Square, folder: string): object => {
    const { level, own } = square;
    const isFinest = level === levels - 1;
    const coarser = levels - 1 - level;
    if (isFinest || !isHollow)
      files.set(
        nameOf(square),
        splatGlb(
          pick(
            cloud,
            own.filter((_, k) => k % 4 ** coarser === 0),
            2 ** coarser,
          ),
        ),
      );
    const common = { boundingVolume: { box: boxAt(square) }, geometricError: errorAt(level), refine: 'REPLACE' };
    const content = isFinest || !isHollow ? { content: { uri: `${folder}${nameOf(square)}` } } : {};
    const inner = (up: string): object[] =>
      isFinest ? [] : below(square).flatMap((child) => (child.own.length > 0 ? [tileOf(child, up)] : []));
    if (level === nestedAt && folder === '') {
      const uri = `in/${level}-${square.x}-${square.y}.json`;
      const root = {
        ...common,
        ...(isFinest || !isHollow ? { content: { uri: `../${nameOf(square)}` } } : {}),
        children: inner('../'),
      };
      files.set(uri, json({ asset: { version: '1.1' }, geometricError: errorAt(level), root }));
      return { ...common, content: { uri } };
    }
    return { ...common, ...content, children: inner(folder) };
  };
  const root = tileOf({ level: 0, x: 0, y: 0, own: Array.from({ length: count }, (_, i) => i) }, '');
  const placed = { ...root, ...(transform && { transform }) };
  const listed = isImplicit ? { ...placed, ...implicitRoot(files, levels), children: undefined } : placed;
  files.set('tileset.json', json({ asset: { version: '1.1' }, geometricError: errorAt(0), root: listed }));
  return files;
}

/** Adds the subtrees of two levels each to the files. */
function implicitRoot(files: Map<string, Uint8Array>, levels: number): object {
  const exists = (level: number, x: number, y: number): boolean => files.has(`${level}/${x}-${y}.glb`);
  for (let level = 0; level < levels; level += 2) {
    for (let x = 0; x < 2 ** level; x++) {
      for (let y = 0; y < 2 ** level; y++) {
        if (!exists(level, x, y)) continue;
        const childAt = (depth: number, k: number): boolean => {
          const at = (shift: number): number =>
            Array.from({ length: depth }, (_, d) => ((k >> (2 * d + shift)) & 1) << d).reduce(
              (sum, bit) => sum + bit,
              0,
            );
          return exists(level + depth, 2 ** depth * x + at(0), 2 ** depth * y + at(1));
        };
        const [tiles, children] = [[true, 0, 0, 0, 0], Array.from({ length: 16 }, (_, k) => childAt(2, k))];
        for (let k = 0; k < 4; k++) tiles[1 + k] = childAt(1, k);
        const bits = (flags: readonly unknown[]): number[] =>
          Array.from({ length: 8 }, (_, byte) =>
            flags.slice(8 * byte, 8 * byte + 8).reduce<number>((sum, one, k) => sum | (one ? 1 << k : 0), 0),
          );
        files.set(`subtrees/${level}/${x}/${y}.bits`, Uint8Array.from([...bits(tiles), ...bits(children)]));
        files.set(
          `subtrees/${level}/${x}/${y}.json`,
          json({
            buffers: [{ uri: `${y}.bits`, byteLength: 16 }],
            bufferViews: [0, 8].map((byteOffset) => ({ buffer: 0, byteOffset, byteLength: 8 })),
            ...{ tileAvailability: { bitstream: 0 }, contentAvailability: [{ bitstream: 0 }] },
            childSubtreeAvailability: level + 2 < levels ? { bitstream: 1 } : { constant: 0 },
          }),
        );
      }
    }
  }
  return {
    content: { uri: '{level}/{x}-{y}.glb' },
    implicitTiling: {
      ...{ subdivisionScheme: 'QUADTREE', subtreeLevels: 2, availableLevels: levels },
      subtrees: { uri: 'subtrees/{level}/{x}/{y}.json' },
    },
  };
}
