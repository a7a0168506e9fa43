/** Meshes that name the same thing again and again, or announce much with few bytes. */
import { strToU8 } from 'fflate';
import { writeGlb } from './gltf-writer.js';
import type { Multiplied } from './multiplied.js';

const many = <T>(count: number, make: (k: number) => T): T[] => Array.from({ length: count }, (_, k) => make(k));

/** One triangle, with 4 KB behind it for accessors. */
const buffer = new Uint8Array(4096);
const triangle = {
  asset: { version: '2.0' },
  scene: 0,
  scenes: [{ nodes: [0] }],
  nodes: [{ mesh: 0 }] as object[],
  meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }] as object[],
  accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: 'VEC3' }] as object[],
  bufferViews: [{ buffer: 0, byteLength: 4096 }] as object[],
  buffers: [{ byteLength: 4096 }],
};

const mesh = (json: object): Multiplied => ({ file: writeGlb({ ...triangle, ...json }, buffer), isMesh: true });

/** The first bytes of a PNG of 4096 x 4096 pixels: all that is read before it is decoded. */
function pngHeader(): Uint8Array {
  const bytes = new Uint8Array(64);
  bytes.set([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10]);
  const view = new DataView(bytes.buffer);
  view.setUint32(16, 4096);
  view.setUint32(20, 4096);
  return bytes;
}
const png = `data:image/png;base64,${Buffer.from(pngHeader()).toString('base64')}`;
const textured = (k: number): object => ({ pbrMetallicRoughness: { baseColorTexture: { index: k } } });
const drawn = (materials: number): object => ({
  meshes: [{ primitives: many(materials, (material) => ({ attributes: { POSITION: 0 }, material })) }],
});

/** Cases by the multiplied part. */
export const MULTIPLIED_MESHES: Readonly<Record<string, (factor: number) => Multiplied>> = {
  'mesh: points of an accessor without a view': (n) =>
    mesh({ accessors: [{ componentType: 5126, count: 50 * n, type: 'VEC3' }] }),
  'mesh: nodes of a mesh': (n) => mesh({ nodes: many(n, () => ({ mesh: 0 })), scenes: [{ nodes: many(n, (k) => k) }] }),
  'mesh: triangles of many nodes': (n) =>
    mesh({
      accessors: [
        { bufferView: 0, componentType: 5126, count: 3, type: 'VEC3' },
        { componentType: 5125, count: 3e5, type: 'SCALAR' },
      ],
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
      ...{ nodes: many(n, () => ({ mesh: 0 })), scenes: [{ nodes: many(n, (k) => k) }] },
    }),
  'mesh: instances of a node': (n) =>
    mesh({
      nodes: [{ mesh: 0, extensions: { EXT_mesh_gpu_instancing: { attributes: { TRANSLATION: 1 } } } }],
      accessors: [...triangle.accessors, { componentType: 5126, count: 20 * n, type: 'VEC3' }],
    }),
  'mesh: primitives': (n) => mesh({ meshes: [{ primitives: many(n, () => ({ attributes: { POSITION: 0 } })) }] }),
  'mesh: materials': (n) => mesh({ ...drawn(n), materials: many(n, () => ({})) }),
  'mesh: images': (n) =>
    mesh({
      ...{ ...drawn(n), materials: many(n, textured), textures: many(n, (source) => ({ source })) },
      images: many(n, () => ({ uri: png })),
    }),
  'mesh: textures of an image': (n) =>
    mesh({
      ...{ ...drawn(n), materials: many(n, textured), textures: many(n, () => ({ source: 0 })) },
      images: [{ uri: png }],
    }),
  'mesh: lights': (n) =>
    mesh({
      nodes: [
        { mesh: 0, children: many(n, (k) => k + 1) },
        ...many(n, () => ({ extensions: { KHR_lights_punctual: { light: 0 } } })),
      ],
      ...{
        extensionsUsed: ['KHR_lights_punctual'],
        extensions: { KHR_lights_punctual: { lights: [{ type: 'point' }] } },
      },
    }),
  'mesh: morph targets of an accessor': (n) =>
    mesh({
      accessors: [{ bufferView: 0, componentType: 5126, count: 300, type: 'VEC3' }],
      meshes: [{ primitives: [{ attributes: { POSITION: 0 }, targets: many(n, () => ({ POSITION: 0 })) }] }],
    }),
  'mesh: views of a buffer': (n) =>
    mesh({
      accessors: many(n, (bufferView) => ({ bufferView, componentType: 5126, count: 3, type: 'VEC3' })),
      bufferViews: many(n, () => ({ buffer: 0, byteLength: 4096 })),
      meshes: [{ primitives: many(n, (POSITION) => ({ attributes: { POSITION } })) }],
    }),
  'mesh: channels of an animation': (n) =>
    mesh({
      accessors: [...triangle.accessors, { bufferView: 0, componentType: 5126, count: 3, type: 'SCALAR' }],
      animations: [
        {
          samplers: [{ input: 1, output: 0 }],
          channels: many(n, () => ({ sampler: 0, target: { node: 0, path: 'translation' } })),
        },
      ],
    }),
  'mesh: elements of a view of meshopt': (n) =>
    mesh({
      accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: 'VEC3' }],
      bufferViews: [
        {
          ...{ buffer: 0, byteLength: 36 },
          extensions: {
            EXT_meshopt_compression: { buffer: 0, byteLength: 45, byteStride: 12, count: 10 * n, mode: 'ATTRIBUTES' },
          },
        },
      ],
    }),
  'mesh: joints': (n) =>
    mesh({
      nodes: [{ mesh: 0, skin: 0, children: [1] }, {}],
      skins: [{ joints: many(n, () => 1) }],
    }),
  'mesh: letters of a name': (n) => mesh({ nodes: [{ mesh: 0, name: 'a'.repeat(n) }] }),
  'mesh: nodes below one another': (n) =>
    mesh({ nodes: many(Math.min(n, 30_000), (k) => ({ mesh: 0, children: [k + 1] })).concat({} as never) }),
  'mesh: lists in its JSON': (n) => ({
    file: strToU8(`{"asset":{"version":"2.0"},"nodes":[${'[],'.repeat(10 * n)}[]]}`),
    isMesh: true,
  }),
};
