/** Damaged files: every reader must survive them without a crash, a hang, or unbounded memory. */
import { zipSync } from 'fflate';
import { GaussianSplatError, validateCloud } from '@gaussian-splat/core';
import { readPrefix, readScene } from '@gaussian-splat/formats';
import { seededRandom, type Random } from '../../support/random.js';
import { assertHelpful } from './expect.js';
import { buildGltf, writeGlb } from './gltf-writer.js';
import { writeKsplat } from './ksplat-writer.js';
import { writePly } from './ply-writer.js';
import { smallCloud } from './small-cloud.js';
import { writeRad } from './rad-writer.js';
import { writeSog, writeSogV1, type SogFiles } from './sog-writer.js';
import { inriaColumns, rawSplats } from './splats.js';
import { writeSpz } from './spz-writer.js';

/** A scene to damage: its main file, and the others that it names. */
export interface FuzzScene {
  readonly name: string;
  readonly files: Readonly<Record<string, Uint8Array>>;
}

const one = (name: string, bytes: Uint8Array): FuzzScene => ({ name, files: { [name]: bytes } });
const cloud = smallCloud(12, 1);
const raw = rawSplats(12, 1);
const within = (folder: string, files: SogFiles): SogFiles =>
  Object.fromEntries(Object.entries(files).map(([path, bytes]) => [`${folder}/${path}`, bytes]));

function streamed(): FuzzScene {
  const bound = { min: [-2, -2, -2], max: [2, 2, 2] };
  const leaf = { bound, lods: { 0: { file: 0, offset: 0, count: 12 }, 1: { file: 1, offset: 0, count: 5 } } };
  const filenames = ['a/meta.json', 'b/meta.json'];
  const meta = { version: 1, count: 17, counts: [12, 5], lodLevels: 2, filenames, tree: { bound, children: [leaf] } };
  const parts = { ...within('a', writeSog(cloud)), ...within('b', writeSog(smallCloud(5, 0))) };
  return { name: 'lod-meta.json', files: { 'lod-meta.json': Buffer.from(JSON.stringify(meta)), ...parts } };
}

/** The same with bundles. */
function bundled(): FuzzScene {
  const { name, files } = streamed();
  const index = Buffer.from(Buffer.from(files[name]).toString().replaceAll('/meta.json', '.sog'));
  const bundles = { 'a.sog': zipSync(writeSog(cloud), { level: 0 }), 'b.sog': zipSync(writeSog(smallCloud(5, 0))) };
  return { name, files: { [name]: index, ...bundles } };
}

/** A glTF some of whose numbers are sparse, in a buffer of their own. */
function sparseGltf(json: Record<string, unknown>, buffer: Buffer): FuzzScene {
  const views = json.bufferViews as object[];
  const sparse = {
    count: 2,
    indices: { bufferView: views.length, componentType: 5121 },
    values: { bufferView: views.length, byteOffset: 4 },
  };
  const accessors = (json.accessors as object[]).map((accessor, k) => (k === 4 ? { ...accessor, sparse } : accessor));
  const bufferViews = [...views, { buffer: 1, byteOffset: 0, byteLength: 28 }];
  const buffers = [
    { uri: 'a.bin', byteLength: buffer.length },
    { uri: 'b.bin', byteLength: 28 },
  ];
  const own = Buffer.alloc(28, 1);
  own.set([3, 7]);
  const text = Buffer.from(JSON.stringify({ ...json, accessors, bufferViews, buffers }));
  return { name: 'a.gltf', files: { 'a.gltf': text, 'a.bin': buffer, 'b.bin': own } };
}

function compressedPly(): Uint8Array {
  const bounds = ['min_', 'max_', 'min_scale_', 'max_scale_'].flatMap((bound) =>
    ['x', 'y', 'z'].map((axis) => bound + axis),
  );
  const packed = ['position', 'rotation', 'scale', 'color'];
  return writePly([
    { name: 'chunk', columns: bounds.map((name, k) => ({ name, type: 'float' as const, values: [k % 5] })) },
    {
      name: 'vertex',
      columns: packed.map((name) => ({
        name: `packed_${name}`,
        type: 'uint' as const,
        values: Array.from({ length: 12 }, (_, i) => (i * 0x9e3779b1) >>> 0),
      })),
    },
  ]);
}

function splatFile(): Uint8Array {
  const bytes = new Uint8Array(32 * 12);
  const view = new DataView(bytes.buffer);
  for (let i = 0; i < 12; i++) {
    for (let k = 0; k < 6; k++) view.setFloat32(32 * i + 4 * k, 0.1 * (k + 1) + i, true);
    bytes.set([1, 2, 3, 255, 255, 128, 128, 128], 32 * i + 24);
  }
  return bytes;
}

const tileset = (children: readonly object[]): Buffer =>
  Buffer.from(JSON.stringify({ asset: { version: '1.1' }, geometricError: 9, root: { refine: 'ADD', children } }));

/** One scene and more of every format. */
export function fuzzScenes(): Readonly<Record<string, readonly FuzzScene[]>> {
  const { json, buffer } = buildGltf(
    [[{ cloud }], [{ cloud, spz: writeSpz(raw, { version: 2 }) }]],
    [{ mesh: 0 }, { mesh: 1 }],
    [0, 1],
  );
  const columns = inriaColumns(raw);
  const longs = [{ name: 'id', type: 'int64' as const, listCountType: 'uint64' as const, values: [[1, 2], [], [3]] }];
  return {
    ply: [
      one('a.ply', writePly([{ name: 'vertex', columns }])),
      one('a.ply', writePly([{ name: 'vertex', columns }], { encoding: 'ascii' })),
      one('a.ply', writePly([{ name: 'ids', columns: longs }, { name: 'vertex', columns }])), // prettier-ignore
    ],
    'compressed-ply': [one('a.compressed.ply', compressedPly())],
    spz: [
      one('a.spz', writeSpz(raw, { version: 2 })),
      one('a.spz', writeSpz(raw, { version: 3 })),
      one('a.spz', writeSpz(raw, { version: 4 })),
    ],
    splat: [one('a.splat', splatFile())],
    ksplat: ([0, 1, 2] as const).map((level) => one('a.ksplat', writeKsplat(cloud, { level }))),
    sog: [
      { name: 'meta.json', files: writeSog(cloud) },
      { name: 'meta.json', files: writeSogV1(cloud) },
    ],
    lod: [streamed(), bundled()],
    gltf: [
      one('a.glb', writeGlb(json, buffer)),
      sparseGltf(json, buffer),
      {
        name: 'a.gltf',
        files: {
          'a.gltf': Buffer.from(JSON.stringify({ ...json, buffers: [{ uri: 'a.bin', byteLength: buffer.length }] })),
          'a.bin': buffer,
        },
      },
    ],
    rad: [
      { name: 'scene.rad', files: writeRad(cloud, { chunkSize: 8, isSplit: true }) },
      { name: 'scene.rad', files: writeRad(cloud, { palette: 4, children: [2, ...Array<number>(11).fill(0)] }) },
    ],
    tiles: [
      {
        name: 'tileset.json',
        files: {
          'tileset.json': tileset([{ content: { uri: 'a.glb' } }, { contents: [{ uri: 'b/tileset.json?x' }] }]),
          'b/tileset.json': tileset([
            { transform: [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 5, 5, 1], content: { uri: 'b.glb' } },
          ]),
          'a.glb': writeGlb(json, buffer),
          'b/b.glb': writeGlb(json, buffer),
        },
      },
    ],
    zip: [
      one('a.sog', zipSync(writeSog(cloud), { level: 0 })),
      one('a.zip', zipSync({ 'x/a.ksplat': writeKsplat(cloud, { level: 1 }) })),
    ],
  };
}

/** Numbers that headers do not expect. */
const EXTREMES = [0, 1, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x7fffffff, 0x80000000, 0xffffffff];

/** A file with a few bytes, words, digits or stretches changed. */
function damage(file: Uint8Array, random: Random): Uint8Array {
  let bytes: Uint8Array = Uint8Array.from(file);
  const below = (n: number): number => Math.floor(random.uniform(0, n));
  for (let changes = 1 + below(4); changes > 0 && bytes.length > 0; changes--) {
    // Half of the changes go to the first bytes, which hold the counts.
    const at = below(random.uniform(0, 1) < 0.5 ? Math.min(bytes.length, 256) : bytes.length);
    switch (below(7)) {
      case 0:
        bytes[at] = below(256);
        break;
      case 1:
        bytes[at] ^= 1 << below(8);
        break;
      case 2:
        if (at + 4 <= bytes.length) new DataView(bytes.buffer).setUint32(at, EXTREMES[below(EXTREMES.length)], true);
        break;
      case 3:
        bytes = bytes.slice(0, at);
        break;
      case 4:
        bytes.copyWithin(at, below(bytes.length), below(bytes.length));
        break;
      case 5:
        bytes.fill(below(2) * 255, at, at + below(40));
        break;
      default: {
        // Texts: another digit, and a longer number.
        const text = Buffer.from(bytes).toString('latin1');
        const digit = text.slice(at, at + 400).search(/\d/);
        if (digit >= 0) {
          const number = ['9', '0', '99999999999', '-1', '1e99'][below(5)];
          bytes = new Uint8Array(
            Buffer.from(text.slice(0, at + digit) + number + text.slice(at + digit + 1), 'latin1'),
          );
        }
      }
    }
  }
  return bytes;
}

export interface FuzzTally {
  files: number;
  read: number;
  refused: number;
  /** Refusals by code. */
  readonly codes: Record<string, number>;
  slowestMs: number;
  /** Peak bytes of array buffers that one file had allocated when it was read. */
  maxBytes: number;
}

/** A damaged scene may take no longer than this, ms, however busy the machine. */
const MAX_MS = 5_000;
/** Nor more memory: the sound files have about 10 KB. */
const MAX_BYTES = 200e6;

/** Reads `count` damaged copies of a format's scenes. Throws at the first that breaks a rule, and says how to make it again. */
export async function fuzzFormat(
  format: string,
  scenes: readonly FuzzScene[],
  count: number,
  seed = 1,
): Promise<FuzzTally> {
  const tally: FuzzTally = { files: 0, read: 0, refused: 0, codes: {}, slowestMs: 0, maxBytes: 0 };
  for (let k = 0; k < count; k++) {
    const random = seededRandom(seed * 1_000_003 + k);
    const { name, files } = scenes[k % scenes.length];
    const paths = Object.keys(files);
    const victim = random.uniform(0, 1) < 0.6 ? name : paths[Math.floor(random.uniform(0, paths.length))];
    const damaged = { ...files, [victim]: damage(files[victim], random) };
    const where = `${format}, file ${k} of seed ${seed}`;
    await readDamaged(name, damaged, tally, where);
  }
  return tally;
}

async function readDamaged(
  name: string,
  files: Record<string, Uint8Array>,
  tally: FuzzTally,
  where: string,
): Promise<void> {
  const openFile = async (path: string): Promise<Uint8Array> => {
    const file = files[path];
    if (file) return file;
    throw new GaussianSplatError('network/status', {
      where: `${name}, ${path}`,
      expected: 'a file',
      found: 'none',
      remedy: 'look',
    });
  };
  const before = process.memoryUsage().arrayBuffers;
  const start = performance.now();
  try {
    validateCloud(await readScene(files[name], { name, openFile, onPreview: () => undefined }));
    tally.read++;
  } catch (error) {
    if (!(error instanceof GaussianSplatError)) throw new Error(`${where}: an error without a name`, { cause: error });
    assertHelpful(error, name);
    tally.refused++;
    tally.codes[error.code] = (tally.codes[error.code] ?? 0) + 1;
  }
  await readPrefix(files[name], { name });
  const ms = performance.now() - start;
  const bytes = process.memoryUsage().arrayBuffers - before;
  tally.files++;
  tally.slowestMs = Math.max(tally.slowestMs, ms);
  tally.maxBytes = Math.max(tally.maxBytes, bytes);
  if (ms > MAX_MS) throw new Error(`${where}: ${ms.toFixed(0)} ms`);
  if (bytes > MAX_BYTES) throw new Error(`${where}: ${bytes} bytes`);
}
