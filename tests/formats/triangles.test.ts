/** Triangles of glTF files: the data for a viewer, and refusals before it. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { LoadBudget, readTriangles, type TriangleFile } from '@gaussian-splat/formats';
import { withMeshopt, writeGlb } from './support/gltf-writer.js';

const FIXTURES = new URL('../element/browser/fixtures/', import.meta.url);
const triangle = {
  asset: { version: '2.0' },
  scenes: [{ nodes: [0] }],
  nodes: [{ mesh: 0, name: 'a', extras: { b: 1 } }],
  meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
  accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: 'VEC3' }],
  bufferViews: [{ buffer: 0, byteLength: 36 }],
  buffers: [{ byteLength: 36, uri: 'https://elsewhere.example/corners.bin' }],
};
const corners = new Uint8Array(Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0).buffer);

function read(file: object | Uint8Array, asked: string[] = []): Promise<TriangleFile> {
  const bytes = file instanceof Uint8Array ? file : new TextEncoder().encode(JSON.stringify(file));
  const openUri = async (uri: string): Promise<Uint8Array> => {
    asked.push(uri);
    return corners;
  };
  return readTriangles({ bytes, name: 'a.gltf', budget: new LoadBudget(bytes.length), openUri });
}
const fixture = (name: string): Uint8Array => new Uint8Array(readFileSync(new URL(name, FIXTURES)));

test('the JSON names no file, and its views are copies', async () => {
  const asked: string[] = [];
  const { json, views, triangles, byteLength } = await read(triangle, asked);
  assert.deepEqual(
    asked,
    triangle.buffers.map(({ uri }) => uri),
    'addresses go to the caller, who judges them',
  );
  assert.doesNotMatch(JSON.stringify(json), /elsewhere|"name"|extras/);
  assert.deepEqual(views, [corners]);
  assert.notEqual((views[0] as Uint8Array).buffer, corners.buffer);
  assert.deepEqual([triangles, byteLength], [1, 36]);
});

test('textures within a GLB come as image files, compressed views as their content', async () => {
  const textured = await read(fixture('textured.glb'));
  const [image] = textured.images;
  assert.deepEqual([image?.type, (image?.width ?? 0) > 0, image?.bytes[1]], ['image/png', true, 0x50]);
  assert.ok(textured.byteLength > 60, 'textures count');
  const plain = {
    ...{ ...triangle, extensionsUsed: [], buffers: [{ byteLength: 36 }] },
    bufferViews: [{ buffer: 0, byteOffset: 0, byteLength: 36 }],
  };
  const { json, buffer } = await withMeshopt(plain, corners, 'EXT_meshopt_compression');
  const [view] = (await read(writeGlb(json, buffer))).views;
  assert.deepEqual(view, corners);
  assert.equal(view.buffer.byteLength, 36, 'in a buffer of its own');
});

/** Accessors without views: their elements are zeros, and take no bytes of the file. */
const zeros = (count: number, type: string, componentType = 5126): object => ({ count, type, componentType });
const changed = (change: object): object => ({ ...triangle, ...change });
const REFUSED: Readonly<Record<string, [file: object, message: RegExp]>> = {
  'a node with two parents': [changed({ nodes: [{ mesh: 0, children: [0] }] }), /one parent.*decode\/header/],
  'an accessor beyond its view': [
    changed({ accessors: [{ ...triangle.accessors[0], count: 4 }] }),
    /accessors\[0\]: expected 48 bytes, found 36.*decode\/corrupt/,
  ],
  'an offset that no array may have': [
    changed({ accessors: [{ ...triangle.accessors[0], count: 1, byteOffset: 2 }] }),
    /a multiple of 4.*decode\/header/,
  ],
  'a view beyond its buffer': [changed({ bufferViews: [{ buffer: 0, byteLength: 40 }] }), /40 bytes.*36.*truncated/],
  'a scene without meshes': [changed({ nodes: [{}] }), /a scene with meshes.*decode\/empty/],
  'an image that is none': [
    changed({
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, material: 0 }] }],
      materials: [{ emissiveTexture: { index: 0 } }],
      ...{ textures: [{ source: 0 }], images: [{ uri: 'a.png' }] },
    }),
    /images\[0\]: expected a PNG, JPEG or WebP image, or a KTX2 image.*decode\/unsupported/,
  ],
  'no mesh of that number': [changed({ meshes: [] }), /meshes\[0\].*decode\/header/],
  'no list of primitives': [changed({ meshes: [{}] }), /primitives.*a list.*decode\/header/],
  'an attribute with fewer elements than vertices': [
    changed({
      accessors: [triangle.accessors[0], { ...triangle.accessors[0], count: 2 }],
      meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1 } }] }],
    }),
    /attributes\.NORMAL: expected 3 of VEC3, found .*2.*decode\/header/,
  ],
  'positions that are matrices': [
    changed({ accessors: [zeros(3, 'MAT4')] }),
    /attributes\.POSITION: expected 3 of VEC3, found .*MAT4.*decode\/header/,
  ],
  'indices that are no whole numbers': [
    changed({
      accessors: [triangle.accessors[0], zeros(3, 'SCALAR')],
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    }),
    /indices: expected whole numbers.*decode\/header/,
  ],
  'a stride that is no whole number of words': [
    changed({
      accessors: [{ ...triangle.accessors[0], componentType: 5121 }],
      bufferViews: [{ buffer: 0, byteLength: 36, byteStride: 7 }],
    }),
    /byteStride: expected a stride.*decode\/header/,
  ],
  'a stride that is a text, of no elements': [
    changed({
      accessors: [{ ...triangle.accessors[0], count: 0 }],
      bufferViews: [{ buffer: 0, byteLength: 36, byteStride: 'x' as never }],
    }),
    /byteStride: expected a stride.*decode\/header/,
  ],
  'a primitive that is none': [changed({ meshes: [{ primitives: [null] }] }), /decode\/header/],
};

const BUDGET = /out-of-memory\/budget/;
const many = <T>(count: number, make: (k: number) => T): T[] => Array.from({ length: count }, (_, k) => make(k));
const png = new Uint8Array(64);
png.set([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
new DataView(png.buffer).setUint32(16, 512);
new DataView(png.buffer).setUint32(20, 512);
const textured = { index: 0, extensions: { KHR_texture_transform: { scale: [2, 2] } } };

/** Files that contain an object once. three.js makes many of it. */
const MULTIPLIED: Readonly<Record<string, object>> = {
  'instances of a node, for each primitive of its mesh': changed({
    nodes: [{ mesh: 0, extensions: { EXT_mesh_gpu_instancing: { attributes: { TRANSLATION: 1 } } } }],
    accessors: [zeros(3, 'VEC3'), zeros(150_000, 'VEC3'), zeros(2, 'SCALAR', 5123)],
    meshes: [{ primitives: many(150, () => ({ attributes: { POSITION: 0 }, indices: 2 })) }],
  }),
  'an image, for each transform of a texture': changed({
    accessors: [zeros(3, 'VEC3')],
    meshes: [{ primitives: many(100, (material) => ({ attributes: { POSITION: 0 }, material })) }],
    materials: many(100, () => ({ emissiveTexture: textured })),
    textures: [{ source: 0 }],
    images: [{ uri: `data:image/png;base64,${Buffer.from(png).toString('base64')}` }],
  }),
  'times of a sampler, for each channel': changed({
    accessors: [zeros(3, 'VEC3'), zeros(4_000_000, 'SCALAR', 5121), zeros(1, 'VEC3')],
    animations: [
      {
        samplers: [{ input: 1, output: 2 }],
        channels: many(100, () => ({ sampler: 0, target: { node: 0, path: 'translation' } })),
      },
    ],
  }),
  'a channel of weights, for each child of its node': changed({
    nodes: [{ mesh: 0, children: many(200, (k) => k + 1) }, ...many(200, () => ({}))],
    accessors: [zeros(3, 'VEC3'), zeros(1, 'SCALAR')],
    animations: [
      {
        samplers: [{ input: 1, output: 1 }],
        channels: many(200, () => ({ sampler: 0, target: { node: 0, path: 'weights' } })),
      },
    ],
  }),
  'bytes between the elements of an accessor': changed({
    accessors: [zeros(3, 'VEC3'), ...many(30, () => ({ ...zeros(10_000, 'SCALAR', 5121), bufferView: 0 }))],
    bufferViews: [{ buffer: 0, byteLength: 2_520_000, byteStride: 252 }],
    meshes: [
      { primitives: [{ attributes: { POSITION: 0, ...Object.fromEntries(many(30, (k) => [`_${k}`, k + 1])) } }] },
    ],
  }),
  'vertices of a mesh, for each of its nodes': changed({
    scenes: [{ nodes: many(200, (k) => k) }],
    nodes: many(200, () => ({ mesh: 0 })),
    accessors: [zeros(500_000, 'VEC3'), zeros(3, 'SCALAR', 5123)],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
  }),
};
for (const [what, file] of Object.entries(MULTIPLIED))
  test(`charged: ${what}`, () => assert.rejects(read(file), BUDGET));

test('extensions that are not drawn are named', async () => {
  const extensionsUsed = ['KHR_texture_transform', 'EXT_structural_metadata', 'KHR_animation_pointer', 'MSFT_lod'];
  const { warnings } = await read(changed({ extensionsUsed }));
  assert.deepEqual(warnings, ['Extensions of glTF that are not known are left out: KHR_animation_pointer, MSFT_lod.']);
});

test('unlit materials need not be listed, and glossy ones get a roughness', async () => {
  const drawn = many(2, (material) => ({ attributes: { POSITION: 0 }, material }));
  const glossy = { diffuseFactor: [1, 0.5, 0, 1], specularFactor: [0.04, 0.02, 0.08], glossinessFactor: 0.75 };
  const { json } = await read(
    changed({
      meshes: [{ primitives: drawn }],
      materials: [
        { extensions: { KHR_materials_unlit: {} } },
        { extensions: { KHR_materials_pbrSpecularGlossiness: glossy } },
      ],
    }),
  );
  assert.ok((json.extensionsUsed as string[]).includes('KHR_materials_unlit'));
  const [, { pbrMetallicRoughness, extensions }] = json.materials as {
    pbrMetallicRoughness: Record<string, unknown>;
    extensions: Record<string, { specularColorFactor?: number[] }>;
  }[];
  const { baseColorFactor, metallicFactor, roughnessFactor } = pbrMetallicRoughness;
  assert.deepEqual([baseColorFactor, metallicFactor, roughnessFactor], [[1, 0.5, 0, 1], 0, 0.25]);
  assert.deepEqual(extensions.KHR_materials_specular.specularColorFactor, [1, 0.5, 2]);
});

test('weights beyond the morph targets are left out', async () => {
  const weights = many(1_000, () => 1);
  const { json } = await read(
    changed({
      nodes: [{ mesh: 0, weights }],
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, targets: [{ POSITION: 0 }] }], weights }],
    }),
  );
  const [[node], [mesh]] = [json.nodes, json.meshes] as { weights: number[] }[][];
  assert.deepEqual([node.weights, mesh.weights], [[1], [1]]);
});

for (const [what, [file, message]] of Object.entries(REFUSED))
  test(`refused by name: ${what}`, () => assert.rejects(read(file), message));

const PLY_HEADER = (encoding: string, vertices: string, faces: number, count = 4): string =>
  `ply\nformat ${encoding} 1.0\nelement vertex ${count}\n${vertices}element face ${faces}\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n`;
const XYZ = 'property float x\nproperty float y\nproperty float z\n';
const RGB = 'property uchar red\nproperty uchar green\nproperty uchar blue\n';
const text = (content: string): Uint8Array => new TextEncoder().encode(content);
const floatsIn = (view: TriangleFile['views'][number]): number[] => [
  ...new Float32Array((view as Uint8Array).slice().buffer),
];

test('a PLY mesh: polygons as fans, colors linear, either byte order, and text', async () => {
  const rows = ['0 0 0 255 0 0', '1 0 0 0 255 0', '1 1 0 0 0 255', '0 1 nan 188 188 188'];
  const ascii = text(`${PLY_HEADER('ascii', XYZ + RGB, 3)}${rows.join('\n')}\n7 4 0 1 2 1\n7 3 0 1 3\n7 2 0 1\n`);
  const file = await read(ascii);
  // Vertex 3 has no place: its triangle is left out.
  assert.equal(file.triangles, 2);
  assert.deepEqual([...new Uint32Array((file.views[2] as Uint8Array).slice().buffer)], [0, 1, 2, 0, 2, 1]);
  assert.deepEqual(floatsIn(file.views[0]).slice(0, 9), [0, 0, 0, 1, 0, 0, 1, 1, 0]);
  const colors = new Uint16Array((file.views[1] as Uint8Array).slice().buffer);
  assert.deepEqual([...colors.slice(0, 4), Math.round(colors[12] / 655.35)], [65_535, 0, 0, 65_535, 50]);
  for (const little of [true, false]) {
    const head = text(PLY_HEADER(little ? 'binary_little_endian' : 'binary_big_endian', XYZ, 1));
    const body = new DataView(new ArrayBuffer(48 + 2 + 16));
    [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0].forEach((value, i) => body.setFloat32(4 * i, value, little));
    body.setUint8(49, 4);
    [0, 1, 2, 3].forEach((value, i) => body.setInt32(50 + 4 * i, value, little));
    const binary = await read(new Uint8Array([...head, ...new Uint8Array(body.buffer)]));
    assert.deepEqual([binary.triangles, binary.byteLength], [2, 48 + 24]);
    assert.deepEqual(binary.json.accessors, [
      { componentType: 5126, count: 4, type: 'VEC3', min: [0, 0, 0], max: [1, 1, 0], bufferView: 0 },
      { componentType: 5125, count: 6, type: 'SCALAR', bufferView: 1 },
    ]);
  }
});

test('a PLY that is no mesh, or asks for more than it has, is refused by name', async () => {
  const corner = '0 0 0\n'.repeat(4);
  const cases: [string, RegExp][] = [
    [`ply\nformat ascii 1.0\nelement vertex 1\n${XYZ}end_header\n0 0 0\n`, /faces with vertex_indices.*decode\/empty/],
    [
      `${PLY_HEADER('ascii', XYZ, 1)}${corner}0 3 0 1 4\n`,
      /face 0: expected a vertex from 0 to 3, found 4.*decode\/corrupt/,
    ],
    [`${PLY_HEADER('ascii', XYZ, 1)}${corner}0 3 0 -1 2\n`, /decode\/corrupt/],
    [`${PLY_HEADER('ascii', XYZ, 2)}${corner}0 3 0 1 2\n`, /decode\/truncated/],
    [PLY_HEADER('binary_little_endian', XYZ, 1, 50_000_000), /decode\/truncated/],
    [`${PLY_HEADER('ascii', XYZ, 1)}${corner}0 1000000 0 1 2\n`, /decode\/truncated/],
  ];
  for (const [file, message] of cases)
    await assert.rejects(read(text(file)), ({ message: found }: Error) => message.test(found), file.slice(0, 40));
});

test('a file that is no mesh is named: splats with their format and tag, others with what they are', async () => {
  const splats = new Uint8Array(readFileSync(new URL('../../demo/scenes/skull.spz', import.meta.url)));
  const png = Uint8Array.of(0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0);
  await assert.rejects(read(splats), /a mesh.*Gaussian splats \(SPZ.*src of <gaussian-splat>/s);
  await assert.rejects(read(png), /a mesh.*PNG image.*\.glb, \.gltf or \.ply/s);
});

test('faces of a PLY with very many sides cost what they weigh', async () => {
  // A fan of a million triangles: 2 bytes each.
  const fan = ` 0 1 2${' 1 2'.repeat(500_000)}`;
  const file = text(`${PLY_HEADER('ascii', XYZ, 1)}${'0 0 0\n'.repeat(4)}0 1000003${fan}\n`);
  const start = process.cpuUsage();
  assert.equal((await read(file)).triangles, 1_000_001);
  const { user } = process.cpuUsage(start);
  assert.ok(user < 8e6, `${user / 1e6} s`);
});
