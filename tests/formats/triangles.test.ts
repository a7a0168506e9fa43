/** Triangles of glTF files: what a viewer gets of them, and what is refused before it. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { LoadBudget, readTriangles, type TriangleFile } from '@gaussian-splat/formats';

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

test('textures within a GLB come as image files, compressed views as they are', async () => {
  const textured = await read(fixture('textured.glb'));
  const [image] = textured.images;
  assert.deepEqual([image?.type, (image?.width ?? 0) > 0, image?.bytes[1]], ['image/png', true, 0x50]);
  assert.ok(textured.byteLength > 60, 'textures count');
  const [view] = (await read(fixture('meshopt.glb'))).views;
  assert.ok(view && 'source' in view);
  assert.deepEqual([view.source.length, view.count, view.stride, view.mode], [45, 3, 12, 'ATTRIBUTES']);
});

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
  Draco: [
    changed({ extensionsRequired: ['KHR_draco_mesh_compression'] }),
    /neither Draco nor KTX2.*decode\/unsupported/,
  ],
  KTX2: [changed({ extensionsRequired: ['KHR_texture_basisu'] }), /neither Draco nor KTX2.*decode\/unsupported/],
  'a scene without meshes': [changed({ nodes: [{}] }), /a scene with meshes.*decode\/empty/],
  'an image that is none': [
    changed({
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, material: 0 }] }],
      materials: [{ emissiveTexture: { index: 0 } }],
      ...{ textures: [{ source: 0 }], images: [{ uri: 'a.png' }] },
    }),
    /images\[0\]: expected a PNG, JPEG or WebP image.*decode\/unsupported/,
  ],
  'no mesh of that number': [changed({ meshes: [] }), /meshes\[0\].*decode\/header/],
  'no list of primitives': [changed({ meshes: [{}] }), /primitives.*a list.*decode\/header/],
  'a primitive that is none': [changed({ meshes: [{ primitives: [null] }] }), /decode\/header/],
};
for (const [what, [file, message]] of Object.entries(REFUSED))
  test(`refused by name: ${what}`, () => assert.rejects(read(file), message));
