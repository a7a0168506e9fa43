/** Small sound files of every reader, to damage and to multiply. */
import { readFileSync } from 'node:fs';
import { unzipSync, zipSync } from 'fflate';
import type { SceneFormatName } from '@gaussian-splat/formats';
import { encodeFloorMap } from '@gaussian-splat/formats/floor';
import { clipOf } from '../../support/clips.js';
import { detailFolder } from '../../support/detail-folder.js';
import { fixturePath } from '../../support/generators.js';
import { writeRadTree } from '../../support/rad-tree.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { buildGltf, writeGlb } from './gltf-writer.js';
import { writeKsplat } from './ksplat-writer.js';
import { writeLcc } from './lcc-writer.js';
import { writeLcc2 } from './lcc2-writer.js';
import { MULTIPLIED_MESHES } from './multiplied-meshes.js';
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

/** A quadtree of implicit tiles, of two levels. */
function implicitTiles(glb: Uint8Array): FuzzScene {
  const implicitTiling = {
    ...{ subdivisionScheme: 'QUADTREE', subtreeLevels: 1, availableLevels: 2 },
    subtrees: { uri: 's/{level}/{x}/{y}.json' },
  };
  const subtree = {
    buffers: [{ uri: 'bits.bin', byteLength: 8 }],
    bufferViews: [{ buffer: 0, byteOffset: 0, byteLength: 8 }],
    ...{ tileAvailability: { constant: 1 }, contentAvailability: [{ bitstream: 0 }] },
    childSubtreeAvailability: { constant: 0 },
  };
  const root = { content: { uri: 'c/{level}/{x}/{y}.glb' }, implicitTiling };
  return {
    name: 'tileset.json',
    files: {
      'tileset.json': Buffer.from(JSON.stringify({ asset: { version: '1.1' }, geometricError: 9, root })),
      's/0/0/0.json': Buffer.from(JSON.stringify(subtree)),
      's/0/0/bits.bin': new Uint8Array(8).fill(1),
      'c/0/0/0.glb': glb,
    },
  };
}

function lcc2(): FuzzScene {
  const bundle = (seed: number): Uint8Array => zipSync(writeSog(smallCloud(12, 1, seed)), { level: 0 });
  const node = (name: number, child?: object): object => ({ data: { '3dgs': { name } }, ...(child && { child }) });
  const root = {
    splatFiles: ['d/0.sog', 'd/1.sog', 'd/e.sog'],
    data: { env: { name: 2 } },
    child: [node(0, [node(1)])],
  };
  const meta = Buffer.from(JSON.stringify({ totalLevels: 2, totalSplats: 24, lodSplats: [12, 12], root }));
  return {
    name: 'meta.lcc2',
    files: { 'meta.lcc2': meta, 'd/0.sog': bundle(1), 'd/1.sog': bundle(2), 'd/e.sog': bundle(3) },
  };
}

/** Names of the formats of {@link fuzzScenes}. A new format needs a scene here, or this file is no TypeScript. */
export type FuzzFormat = SceneFormatName | 'tiles';

/** One scene and more of every format of a scene. */
export function fuzzScenes(): Readonly<Record<FuzzFormat, readonly FuzzScene[]>> {
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
      implicitTiles(writeGlb(json, buffer)),
    ],
    lcc: [{ name: 'meta.lcc', files: writeLcc([smallCloud(20, 1), smallCloud(8, 1)], { cellSize: 10 }) }],
    lcc2: [lcc2()],
    usd: [
      one('a.usda', readFileSync(new URL('../../fixtures/usd/scene.usda', import.meta.url))),
      one('a.usdc', readFileSync(new URL('../../fixtures/usd/scene.usdc', import.meta.url))),
    ],
    zip: [
      one('a.sog', zipSync(writeSog(cloud), { level: 0 })),
      one('a.zip', zipSync({ 'x/a.ksplat': writeKsplat(cloud, { level: 1 }) })),
    ],
  };
}

/** Request to a worker: see `WorkerRequest` of the element. */
export type ReaderKind = 'load' | 'levels' | 'tree' | 'clip' | 'manifest' | 'floor' | 'voxels' | 'mesh' | 'model';

/** Readers that are not those of a whole scene. */
export type OtherReader =
  'sequence' | 'streamed' | 'tree' | 'clip' | '4dgs' | 'detail' | 'floor' | 'voxels' | 'mesh' | 'model';

/** A solid block below air, in voxels as splat-transform writes them. */
function voxels(): FuzzScene {
  const bounds = { min: [-1, -1, -1], max: [1, 1, 1] };
  const head = {
    ...{ version: '1.1', gridBounds: bounds, voxelResolution: 0.05, leafSize: 4, treeDepth: 4 },
    ...{ nodeCount: 2, leafDataCount: 0 },
  };
  const tree = new Uint8Array(Uint32Array.of(0x01000001, 0xff000000).buffer);
  return { name: 'a.voxel.json', files: { 'a.voxel.json': Buffer.from(JSON.stringify(head)), 'a.voxel.bin': tree } };
}

export async function otherScenes(): Promise<
  Readonly<Record<OtherReader, { readonly kind: ReaderKind; readonly scenes: readonly FuzzScene[] }>>
> {
  const json = (value: unknown): Uint8Array => Buffer.from(JSON.stringify(value));
  const map = { cell: 0.1, corner: [0, 0], width: 20, depth: 20, step: 0.3, start: [0.1, 0, 0.1], area: 4 } as const;
  const corpus = unzipSync(readFileSync('tests/fixtures/4dgs/corpus.zip'));
  const states = Object.keys(corpus).filter((name) => name.endsWith('.4dgs') && corpus[name].length < 20_000);
  const gsv = await clipOf(() => smallCloud(30, 1), { frames: 6, framesPerGroup: 3 });
  const { manifest, files } = detailFolder(pebbles(2_000));
  const levels = writeRadTree(smallCloud(60, 1), { chunkSize: 16 });
  const lcc2Levels = { name: 'scene.lcc2', files: writeLcc2(smallCloud(24, 1), { levels: 2 }) };
  const pages = Object.fromEntries([...files].map(([path, bytes]) => [path, new Uint8Array(bytes)]));
  const meshes = ['mesh: nodes of a mesh', 'mesh: lights', 'mesh: channels of an animation', 'mesh: joints'];
  return {
    sequence: {
      kind: 'load',
      scenes: [
        one('s.json', json({ gaussianSplatSequence: 1, framesPerSecond: 24, frames: 'f-{09}.spz', count: 20 })),
        one('s.json', json({ gaussianSplatSequence: 1, framesPerSecond: 24, frames: ['a.spz', 'b.spz'] })),
      ],
    },
    streamed: { kind: 'levels', scenes: fuzzScenes().lod },
    tree: { kind: 'tree', scenes: [...fuzzScenes().tiles, ...fuzzScenes().lcc, lcc2Levels, one('scene.rad', levels)] },
    clip: { kind: 'clip', scenes: [one('a.gsv', gsv.bytes)] },
    '4dgs': { kind: 'clip', scenes: states.map((name) => one('a.4dgs', new Uint8Array(corpus[name]))) },
    detail: { kind: 'manifest', scenes: [{ name: 'detail.json', files: { 'detail.json': json(manifest), ...pages } }] },
    floor: {
      kind: 'floor',
      scenes: [1, 3].map((count) =>
        one('a.floor', encodeFloorMap({ ...map, layers: Array.from({ length: count }, () => new Float32Array(400)) })),
      ),
    },
    voxels: { kind: 'voxels', scenes: [voxels()] },
    mesh: {
      kind: 'mesh',
      scenes: [
        ...meshes.map((name) => one('a.glb', MULTIPLIED_MESHES[name](3).file)),
        ...['meshopt', 'draco'].map((name) =>
          one(
            'a.glb',
            new Uint8Array(readFileSync(new URL(`../../element/browser/fixtures/${name}.glb`, import.meta.url))),
          ),
        ),
        one('a.ply', trianglePly()),
      ],
    },
    model: { kind: 'model', scenes: [one('a.onnx', new Uint8Array(readFileSync(fixturePath('packed.onnx'))))] },
  };
}

function trianglePly(): Uint8Array {
  const columns = ['x', 'y', 'z'].map((name, k) => ({ name, type: 'float' as const, values: [k, 1, 2] }));
  const faces = [
    { name: 'vertex_indices', type: 'int' as const, listCountType: 'uchar' as const, values: [[0, 1, 2]] },
  ];
  return writePly([
    { name: 'vertex', columns },
    { name: 'face', columns: faces },
  ]);
}
