/** Files that name the same thing again and again, or announce much with few bytes. */
import { gzipSync } from 'node:zlib';
import { strToU8, zipSync } from 'fflate';
import { buildGltf, writeGlb } from './gltf-writer.js';
import { writeRad } from './rad-writer.js';
import { smallCloud } from './small-cloud.js';
import { writeSog } from './sog-writer.js';
import { writeWebp } from './webp-writer.js';

/** A file that names one thing a number of times, and the file beside it that it names. */
export interface Multiplied {
  readonly file: Uint8Array;
  readonly beside?: Uint8Array;
  /** It is read for its triangles. */
  readonly isMesh?: boolean;
}

const json = (value: unknown): Uint8Array => strToU8(JSON.stringify(value));
const many = <T>(count: number, make: (k: number) => T): T[] => Array.from({ length: count }, (_, k) => make(k));
const bound = { min: [0, 0, 0], max: [1, 1, 1] };

/** Splats of one color, which take next to no bytes. */
function plainSog(side: number): { meta: object; image: Uint8Array } {
  const image = writeWebp(new Uint8Array(4 * side * side).fill(255), side, side);
  const codebook = [0.1];
  return {
    image,
    meta: {
      ...{ version: 2, count: side * side },
      means: { mins: [0, 0, 0], maxs: [1, 1, 1], files: ['i', 'i'] },
      ...{ scales: { codebook, files: ['i'] }, quats: { files: ['i'] }, sh0: { codebook, files: ['i'] } },
    },
  };
}

function lodZip(
  filenames: string[],
  runs: { file: number; offset: number; count: number }[],
  side: number,
): Uint8Array {
  const { meta, image } = plainSog(side);
  const tree = { bound, children: runs.map((run) => ({ bound, lods: { 0: run } })) };
  const index = json({ version: 1, lodLevels: 1, filenames, tree });
  return zipSync({ 'lod-meta.json': index, 's/meta.json': json(meta), 's/i': image });
}

const { json: gltf, buffer } = buildGltf([[{ cloud: smallCloud(400, 3) }]], [{ mesh: 0 }], [0]);
type Primitive = { attributes: Record<string, number> };
const primitive = (gltf.meshes as { primitives: Primitive[] }[])[0].primitives[0];
const plyHeader = (lines: string[]): Uint8Array =>
  strToU8(['ply', 'format ascii 1.0', ...lines, 'end_header', ''].join('\n'));

/** SPZ version 2 of zeros, as many splats as deflate can hold. */
function spz(count: number): Uint8Array {
  const body = new Uint8Array(16 + 64 * count);
  const view = new DataView(body.buffer);
  body.set(strToU8('NGSP'));
  view.setUint32(4, 2, true);
  view.setUint32(8, count, true);
  body[12] = 3;
  return gzipSync(body);
}

/** An archive whose directory gives the same bytes a number of names. */
function overlappingZip(count: number): Uint8Array {
  const inner = { 'a/meta.json': new Uint8Array(1 << 20).fill(32) };
  const one = zipSync(inner);
  const end = one.length - 22;
  const view = new DataView(one.buffer, one.byteOffset);
  const entry = one.subarray(view.getUint32(end + 16, true), end);
  const names = many(Math.min(count, 65_535), (k) => {
    const own = entry.slice();
    own[46] = 97 + (k % 26);
    return own;
  });
  const directory = Buffer.concat(names);
  const tail = one.slice(end);
  const tailView = new DataView(tail.buffer);
  for (const at of [8, 10]) tailView.setUint16(at, names.length, true);
  tailView.setUint32(12, directory.length, true);
  return Buffer.concat([one.subarray(0, view.getUint32(end + 16, true)), directory, tail]);
}

const tiles = (uris: string[]): Uint8Array =>
  json({ asset: {}, geometricError: 1, root: { children: uris.map((uri) => ({ content: { uri } })) } });

/** A stage of OpenUSD that moves a splat by one operation again and again, and the value of the operation. */
const stage = (n: number, value: string): Uint8Array =>
  strToU8(`#usda 1.0
def Xform "A"
{
  float xformOp:rotateX${value}
  uniform token[] xformOpOrder = [${many(n, () => '"xformOp:rotateX"').join(',')}]
  def ParticleField3DGaussianSplat "B"
  {
    float[] opacities = [1]
    quatf[] orientations = [(1, 0, 0, 0)]
    point3f[] positions = [(0, 0, 0)]
    float3[] scales = [(1, 1, 1)]
  }
}
`);

/** Cases by the multiplied part. */
export const MULTIPLIED: Readonly<Record<string, (factor: number) => Multiplied>> = {
  'frames of a pattern': (n) => ({
    file: json({ gaussianSplatSequence: 1, framesPerSecond: 24, frames: `${'a'.repeat(999)}{0}.spz`, count: n }),
  }),
  'digits of a pattern': (n) => ({
    file: json({ gaussianSplatSequence: 1, framesPerSecond: 24, frames: `{${'0'.repeat(n)}}.spz`, count: 1e6 }),
  }),
  'frames of a list': (n) => ({
    file: json({ gaussianSplatSequence: 1, framesPerSecond: 24, frames: many(n, () => 'a') }),
  }),
  'operations of a stage, each with a long value': (n) => ({ file: stage(n, ` = [ #${'c'.repeat(25 * n)}\n 1 ]`) }),
  'operations of a stage, each with many samples': (n) => ({
    file: stage(n, `.timeSamples = { ${many(n, (k) => `${k + 5}: 1`).join(', ')} }`),
  }),
  'names of a streamed SOG': (n) => ({
    file: lodZip(
      many(n, () => 's/meta.json'),
      many(n, (file) => ({ file, offset: 0, count: 65_536 })),
      256,
    ),
  }),
  'runs of a streamed SOG': (n) => ({
    file: lodZip(
      ['s/meta.json'],
      many(n, (k) => ({ file: 0, offset: k % 65_536, count: 1 })),
      256,
    ),
  }),
  'splats of a SOG of one color': (n) => {
    const { meta, image } = plainSog(Math.min(1_500, Math.ceil(Math.sqrt(256 * n))));
    return { file: zipSync({ 'meta.json': json(meta), i: image }, { level: 9 }) };
  },
  'tiles of a tileset': (n) => ({
    file: zipSync({ 'tileset.json': tiles(many(n, () => 'a.glb')), 'a.glb': writeGlb(gltf, buffer) }),
  }),
  'tilesets in a tileset': (n) => ({
    file: zipSync({ 'tileset.json': tiles(many(n, () => 'b.json')), 'b.json': tiles(many(n, () => 'b.json')) }),
  }),
  'chunks of a RAD': (n) => {
    const { 'scene.rad': file } = writeRad(smallCloud(400, 3));
    const start = 8 + 8 * Math.ceil(file.readUInt32LE(4) / 8);
    const [chunk] = (JSON.parse(file.subarray(8, 8 + file.readUInt32LE(4)).toString()) as { chunks: object[] }).chunks;
    const text = Buffer.from(JSON.stringify({ version: 1, type: 'gsplat', chunks: many(n, () => chunk) }));
    const head = Buffer.alloc(8 + 8 * Math.ceil(text.length / 8), 'RAD0');
    head.writeUInt32LE(text.length, 4);
    text.copy(head, 8);
    return { file: Buffer.concat([head, file.subarray(start)]) };
  },
  'splats of a RAD of one color': (n) => {
    const count = Math.min(500_000, 100 * n);
    const zeros = (length: number): Float32Array => new Float32Array(length);
    const cloud = { ...smallCloud(1, 3), count, positions: zeros(3 * count), scales: zeros(3 * count).fill(1) };
    const [opacities, rotations, sh] = [zeros(count).fill(1), zeros(4 * count).fill(1), zeros(48 * count)];
    return { file: writeRad({ ...cloud, opacities, rotations, sh }, { chunkSize: count })['scene.rad'] };
  },
  'spaces before a SOG': (n) => ({ file: zipSync({ 'meta.json': strToU8(' '.repeat(100 * n) + '{}') }) }),
  'lists in the index of a streamed SOG': (n) => ({
    file: zipSync({ 'lod-meta.json': strToU8(`{"lodLevels":[${'[],'.repeat(10 * n)}[]]}`) }),
  }),
  'nodes of a mesh': (n) => ({
    file: writeGlb({ ...gltf, nodes: [{ children: many(n, () => 1) }, { mesh: 0 }], scenes: [{ nodes: [0] }] }, buffer),
  }),
  'children of a node below itself': (n) => ({
    file: writeGlb({ ...gltf, nodes: [{ children: many(n, () => 0) }], scenes: [{ nodes: [0] }] }, buffer),
  }),
  'primitives of a mesh': (n) => ({
    file: writeGlb({ ...gltf, meshes: [{ primitives: many(n, () => primitive) }] }, buffer),
  }),
  'accessors of a view': (n) => {
    const accessors = gltf.accessors as object[];
    const { POSITION } = primitive.attributes;
    const primitives = many(n, (k) => ({
      ...primitive,
      attributes: { ...primitive.attributes, POSITION: accessors.length + k },
    }));
    const more = [...accessors, ...many(n, () => accessors[POSITION])];
    return { file: writeGlb({ ...gltf, accessors: more, meshes: [{ primitives }] }, buffer) };
  },
  'buffers of a file': (n) => {
    const [view] = gltf.bufferViews as object[];
    const [accessor] = gltf.accessors as object[];
    const accessors = many(n, (bufferView) => ({ ...accessor, bufferView }));
    const primitives = many(n, (POSITION) => ({ ...primitive, attributes: { ...primitive.attributes, POSITION } }));
    return {
      file: json({
        ...{ ...gltf, accessors, meshes: [{ primitives }] },
        bufferViews: many(n, (k) => ({ ...view, buffer: k })),
        buffers: many(n, () => ({ uri: 'a.bin', byteLength: buffer.length })),
      }),
      beside: buffer,
    };
  },
  'splats of an SPZ of zeros': (n) => ({ file: spz(10 * n) }),
  'entries of an archive': (n) => ({ file: overlappingZip(n) }),
  'elements of a PLY': (n) => ({ file: plyHeader(many(n, (k) => `element e${k} 0`)) }),
  'properties of a PLY': (n) => ({
    file: plyHeader(['element vertex 1', ...many(n, (k) => `property float f_rest_${k}`)]),
  }),
  'comments of a PLY': (n) => ({ file: plyHeader(many(n, () => 'comment')) }),
  'sections of a ksplat': (n) => {
    const file = new Uint8Array(4096 + 1024 * Math.min(n, 1000));
    file[1] = 1;
    new DataView(file.buffer).setUint32(4, Math.min(n, 1000), true);
    return { file };
  },
  'images of a SOG': (n) => {
    const files = writeSog(smallCloud(400, 3));
    const padded = Object.fromEntries(Object.entries(files).map(([name, bytes]) => [name, bytes]));
    for (const name of Object.keys(padded))
      if (name !== 'meta.json') padded[name] = Buffer.concat([padded[name], new Uint8Array(20 * n)]);
    return { file: zipSync(padded, { level: 9 }) };
  },
};
