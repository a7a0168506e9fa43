/** Meshes with Draco and KTX2: the numbers of their decoders, and the door in front of them. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { Ktx2Decoder, LoadBudget, readTriangles, type LoadLimits, type TriangleFile } from '@gaussian-splat/formats';
import { onlyInLab } from '../support/extent.js';

const fixture = (name: string): Uint8Array<ArrayBuffer> =>
  new Uint8Array(readFileSync(new URL(`../element/browser/fixtures/${name}`, import.meta.url)));
const openUri = (): Promise<never> => Promise.reject(new Error('no other files'));
const read = (bytes: Uint8Array, limits: LoadLimits = {}): Promise<TriangleFile> =>
  readTriangles({ bytes, name: 'a.glb', budget: new LoadBudget(bytes.length, limits), openUri });

/** JSON of a fixture, as far as tests change it. */
interface Changeable {
  extensionsRequired?: string[];
  accessors: { count: number; type: string; bufferView?: number }[];
  bufferViews: { buffer: number; byteLength: number }[];
  buffers: { byteLength: number }[];
  meshes: { primitives: { mode: number; extensions: Record<string, unknown> }[] }[];
}

/** A GLB with other JSON, and other bytes for its only buffer. */
function glbOf(file: Uint8Array, change: (json: Changeable) => void, binary?: Uint8Array): Uint8Array {
  const view = new DataView(file.buffer);
  const length = view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(file.subarray(20, 20 + length))) as Changeable;
  const data = binary ?? file.subarray(28 + length);
  json.buffers[0].byteLength = data.length;
  change(json);
  const text = new TextEncoder().encode(JSON.stringify(json));
  const out = new Uint8Array(28 + text.length + data.length);
  const header = new DataView(out.buffer);
  [0x46546c67, 2, out.length, text.length, 0x4e4f534a].forEach((word, i) => header.setUint32(4 * i, word, true));
  out.set(text, 20);
  header.setUint32(20 + text.length, data.length, true);
  header.setUint32(24 + text.length, 0x004e4942, true);
  out.set(data, 28 + text.length);
  return out;
}

const unchanged = (): void => undefined;

test('Draco: positions, colors of three bytes and indices are those that were compressed', async () => {
  const { json, views, triangles, byteLength } = await read(fixture('draco.glb'));
  assert.equal(triangles, 128);
  const accessors = json.accessors as { bufferView: number; count: number }[];
  const bytesOf = (accessor: number): ArrayBuffer =>
    (views[accessors[accessor].bufferView] as Uint8Array).slice().buffer;
  const [indices, positions] = [new Uint16Array(bytesOf(0)), new Float32Array(bytesOf(1))];
  const colors = new Uint8Array(bytesOf(3));
  assert.deepEqual([indices.length, positions.length, colors.length], [384, 243, 324]);
  assert.equal((json.bufferViews as { byteStride?: number }[])[accessors[3].bufferView].byteStride, 4);
  assert.ok(byteLength >= 768 + 972 + 972 + 324);
  // The surface is z = 0.3 sin(3x) cos(2y), colored by x and y, quantized to 14 bits of its extent.
  for (let i = 0; i < 81; i++) {
    const [x, y, z] = positions.subarray(3 * i, 3 * i + 3);
    assert.ok(Math.abs(z - 0.3 * Math.sin(3 * x) * Math.cos(2 * y)) < 1e-3, `height of vertex ${i}`);
    const expected = [127.5 * (x + 1), 127.5 * (y + 1), 0];
    expected.forEach((value, k) => assert.ok(Math.abs(colors[4 * i + k] - value) <= 1, `color of vertex ${i}`));
  }
  let area = 0;
  for (let i = 0; i < 384; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => positions.subarray(3 * indices[i + k]));
    area += ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2;
  }
  assert.ok(Math.abs(area - 4) < 1e-3, 'the triangles cover the square once, in their order');
});

test('KTX2: the pixels of ETC1S, and of UASTC with Zstandard', async () => {
  const file = fixture('ktx2.glb');
  const { images, byteLength } = await read(file);
  const budget = new LoadBudget(file.length);
  const decoder = new Ktx2Decoder(budget);
  assert.ok(byteLength > 2 * 16 * 16 * 4, 'textures count');
  const expected = { 0: [255, 0, 0, 255], 15: [0, 255, 0, 255], 240: [0, 0, 255, 255], 255: [255, 255, 255, 64] };
  for (const image of images) {
    assert.deepEqual([image?.type, image?.width, image?.height], ['image/ktx2', 16, 16]);
    const pixels = await decoder.decode(image!, 'a');
    assert.equal(pixels.length, 1024);
    for (const [at, color] of Object.entries(expected))
      color.forEach((value, k) => assert.ok(Math.abs(pixels[4 * Number(at) + k] - value) <= 8, `${at}, ${k}`));
  }
  assert.ok(budget.taken > 16_000_000, 'the memory of the decoder is charged');
});

test('a fallback without an extension needs no decoder', async () => {
  const compressed = fixture('draco.glb');
  const plain = glbOf(
    compressed,
    (json) => {
      delete json.extensionsRequired;
      json.accessors = json.accessors.map((accessor) => ({ ...accessor, bufferView: 1 }));
      json.bufferViews.push({ buffer: 0, byteLength: 1024 });
      json.accessors[0].count = 3;
      for (const k of [1, 2, 3]) json.accessors[k].count = 8;
    },
    new Uint8Array(2048),
  );
  // The compressed bytes are zeros, which no decoder takes.
  assert.equal((await read(plain)).triangles, 1);
});

/** A UASTC image of 4096 x 4096 pixels: 16 MiB of zeros, which Zstandard compresses to 521 bytes. */
function largeImage(small: Uint8Array): Uint8Array<ArrayBuffer> {
  const BLOCK = 2 ** 17;
  const blocks = Array.from({ length: 128 }, (_, i) => (i === 127 ? 1 : 0) | (1 << 1) | (BLOCK << 3));
  const runs = blocks.flatMap((block) => [block & 255, (block >> 8) & 255, block >> 16, 0]);
  // Magic number, one segment with a size of four bytes, 2^24.
  const level = [0x28, 0xb5, 0x2f, 0xfd, 0xa0, 0, 0, 0, 1, ...runs];
  const bytes = new Uint8Array(small.length + level.length);
  bytes.set(small);
  bytes.set(level, small.length);
  const view = new DataView(bytes.buffer);
  const [WIDTH, HEIGHT, LEVELS, LEVEL] = [20, 24, 40, 80];
  for (const at of [WIDTH, HEIGHT]) view.setUint32(at, 4096, true);
  view.setUint32(LEVELS, 1, true);
  [small.length, level.length, 2 ** 24].forEach((value, k) => view.setBigUint64(LEVEL + 8 * k, BigInt(value), true));
  return bytes;
}

/** A mesh of Draco, version 2.2: three points, and `faces` of them with indices of a byte, uncompressed. */
function sequentialMesh(faces: number): Uint8Array {
  const varint = (value: number): number[] =>
    value < 128 ? [value] : [(value & 127) | 128, ...varint(Math.floor(value / 128))];
  const [MESH, SEQUENTIAL, RAW, POSITION, FLOAT32, GENERIC] = [1, 0, 1, 0, 9, 0];
  const head = [
    ...new TextEncoder().encode('DRACO'),
    2,
    2,
    MESH,
    SEQUENTIAL,
    0,
    0,
    ...varint(faces),
    ...varint(3),
    RAW,
  ];
  const indices = Array.from({ length: 3 * faces }, (_, i) => i % 3);
  // One decoder with one attribute: its kind, type, components, whether it is normalized, and its id.
  const attributes = [1, ...varint(1), POSITION, FLOAT32, 3, 0, ...varint(0), GENERIC];
  const corners = new Uint8Array(Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0).buffer);
  return Uint8Array.from([...head, ...indices, ...attributes, ...corners]);
}

test('a mesh of Draco costs as much as it has faces, for each primitive that decodes it', async () => {
  const draco = sequentialMesh(20_000);
  const file = (primitives: number): Uint8Array =>
    glbOf(
      fixture('draco.glb'),
      (json) => {
        json.bufferViews = [{ buffer: 0, byteLength: draco.length }];
        json.accessors = Array.from({ length: primitives }, () => ({ componentType: 5126, count: 3, type: 'VEC3' }));
        const extension = { KHR_draco_mesh_compression: { bufferView: 0, attributes: { POSITION: 0 } } };
        json.meshes = [
          {
            primitives: Array.from({ length: primitives }, (_, POSITION) => ({
              ...{ attributes: { POSITION }, mode: 4, extensions: extension },
            })),
          },
        ];
      },
      draco,
    );
  assert.equal((await read(file(2))).triangles, 2);
  // Without the faces, 300 primitives cost 56 MB of the 94 MB that are allowed.
  await assert.rejects(read(file(300)), /out-of-memory\/budget/);
});

test('damaged and excessive files are refused by name', async () => {
  const file = fixture('draco.glb');
  const refused = (bytes: Uint8Array, message: RegExp, limits?: LoadLimits): Promise<void> =>
    assert.rejects(read(bytes, limits), message);
  await refused(
    glbOf(file, (json) => [1, 2, 3].forEach((k) => (json.accessors[k].count = 80))),
    /accessors\[1\]: expected 80 elements in the mesh of Draco, found 81.*decode\/corrupt/,
  );
  await refused(
    glbOf(file, (json) => void (json.accessors[3].type = 'VEC4')),
    /4 bytes an element in the mesh of Draco, found 3.*decode\/corrupt/,
  );
  await refused(
    glbOf(file, (json) => void (json.meshes[0].primitives[0].mode = 5)),
    /4 \(triangles\), found 5.*decode\/unsupported/,
  );
  await refused(
    glbOf(file, (json) => void (json.meshes[0].primitives[0].extensions.KHR_draco_mesh_compression = {})),
    /KHR_draco_mesh_compression.*decode\/header/,
  );
  await refused(glbOf(file, unchanged, new Uint8Array(563)), /a mesh of Draco.*decode\/corrupt/);
  await refused(file, /out-of-memory\/budget/, { maxBytes: 10_000_000 });
  const [, small] = (await read(fixture('ktx2.glb'))).images;
  const large = { ...small!, bytes: largeImage(small!.bytes), width: 4096, height: 4096 };
  // Allows the pixels and the initial memory of the decoder, 84 MB, but no growth for 16 MB.
  const decoder = new Ktx2Decoder(new LoadBudget(100_000));
  await assert.rejects(decoder.decode(large, 'a'), /a: expected at most.*out-of-memory\/budget/);
  // Once the decoder has grown, each image is charged for what Zstandard inflates: 256 bytes here, and 16 MB there.
  const account = new LoadBudget(1_000_000);
  const grown = new Ktx2Decoder(account);
  const chargeOf = async (image: typeof large): Promise<number> => {
    const before = account.taken;
    await grown.decode(image, 'a').catch(() => undefined);
    return account.taken - before;
  };
  for (let i = 0; i < 2; i++) await chargeOf(large);
  const pixels = 4 * 4096 * 4096;
  assert.deepEqual([await chargeOf(large), await chargeOf(small!)], [pixels + 2 ** 24, 4 * 16 * 16 + 256]);
  const other = new Ktx2Decoder(new LoadBudget(0));
  await assert.rejects(other.decode({ ...small!, width: 32 }, 'a'), /32 x 16 pixels.*decode\/corrupt/);
});

test('for any wrong bit of a compressed file, the error has a name', { skip: onlyInLab }, async () => {
  const file = fixture('draco.glb');
  const start = file.length - 564;
  const outcomes = new Set<string>();
  for (let bit = 0; bit < 563 * 8; bit += 331) {
    const bytes = file.slice();
    bytes[start + (bit >> 3)] ^= 1 << (bit & 7);
    outcomes.add(
      await read(bytes).then(
        () => 'read',
        (error: { code?: string }) => String(error.code),
      ),
    );
  }
  assert.deepEqual(
    [...outcomes].filter((outcome) => !/^(read|decode\/corrupt|out-of-memory\/budget)$/.test(outcome)),
    [],
  );
  assert.ok(outcomes.has('decode/corrupt'));
  const images = fixture('ktx2.glb');
  const {
    images: [etc1s, uastc],
  } = await read(images);
  for (const image of [etc1s!, uastc!]) {
    const decoder = new Ktx2Decoder(new LoadBudget(2 ** 20));
    for (let bit = 0; bit < image.bytes.length * 8; bit += 113) {
      const bytes = image.bytes.slice();
      bytes[bit >> 3] ^= 1 << (bit & 7);
      await decoder
        .decode({ ...image, bytes }, 'a')
        .catch((error: { code?: string }) => assert.match(String(error.code), /^(decode|out-of-memory)\//));
    }
  }
});
