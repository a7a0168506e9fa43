import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { isObject } from '../json.js';
import { layoutOf } from './costs.js';
import type { Draco, DracoMesh } from './draco-code.js';
import type { Survey } from './survey.js';
import { WasmDecoder } from './wasm-decoder.js';

const DRACO = 'KHR_draco_mesh_compression';
const TRIANGLES = 4;
/** Bytes charged for each face and each point of a decoded mesh, to bound the work of decoding. */
const DECODED_BYTES = 16;

/** Arrays and data types of Draco by the component types of glTF. */
const TYPES = {
  5120: [Int8Array, 'DT_INT8'],
  5121: [Uint8Array, 'DT_UINT8'],
  5122: [Int16Array, 'DT_INT16'],
  5123: [Uint16Array, 'DT_UINT16'],
  5125: [Uint32Array, 'DT_UINT32'],
  5126: [Float32Array, 'DT_FLOAT32'],
} as const;

/** A primitive that Draco has compressed. */
interface Compressed {
  /** Path of the primitive in the JSON, for error messages. */
  readonly path: string;
  /** Index of the buffer view of the compressed bytes. */
  readonly view: number;
  /** Index of the accessor of each attribute, by the id of the attribute in the compressed mesh. */
  readonly attributes: ReadonlyMap<number, number>;
  readonly indices: number | undefined;
}

/**
 * Decodes the primitives that Draco has compressed, and adds buffer views for their accessors. A primitive whose
 * accessors have buffer views has an uncompressed fallback, and is not decoded.
 * @param survey Used parts of the document. Their accessors are already charged to the budget.
 * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`
 */
export async function decodeDraco(document: GltfDocument, survey: Survey): Promise<void> {
  const found = [...survey.meshes].flatMap((mesh) =>
    survey.primitivesOf(mesh).flatMap((primitive, k) => {
      return compressedIn(document, primitive, `meshes[${mesh}].primitives[${k}]`) ?? [];
    }),
  );
  const decoder = new WasmDecoder('Draco', document.budget, () => import('./draco-code.js'));
  /** Index of the compressed buffer view that has provided each accessor. */
  const done = new Map<number, number>();
  for (const primitive of found) {
    const { path, view } = primitive;
    const accessors = [
      ...primitive.attributes.values(),
      ...(primitive.indices === undefined ? [] : [primitive.indices]),
    ];
    if (accessors.every((accessor) => done.get(accessor) === view)) continue;
    if (accessors.some((accessor) => done.has(accessor)))
      document.fail(path, 'accessors that no other compressed mesh has', accessors);
    const bytes = await document.readView(view);
    await decoder.run(`${document.name}, ${path}`, (draco) => decode(draco, bytes, primitive, document));
    for (const accessor of accessors) done.set(accessor, view);
  }
}

/** Validates the extension of a primitive. Returns undefined without the extension, or with an uncompressed fallback. */
function compressedIn(document: GltfDocument, primitive: Json, path: string): Compressed | undefined {
  const { extensions, attributes, indices, mode = TRIANGLES } = primitive;
  if (!isObject(extensions) || extensions[DRACO] === undefined) return undefined;
  const { POSITION } = attributes as Json;
  if (document.item('accessors', POSITION).bufferView !== undefined) return undefined;
  const own = extensions[DRACO];
  if (!isObject(own) || !isObject(own.attributes) || !document.isIndex(own.bufferView))
    return document.fail(`${path}.extensions.${DRACO}`, 'a buffer view and attributes', own);
  if (mode !== TRIANGLES)
    throw damaged(
      `${document.name}, ${path}.mode`,
      '4 (triangles)',
      `${String(mode)}, with Draco`,
      'decode/unsupported',
    );
  const ids = new Map<number, number>();
  for (const [name, id] of Object.entries(own.attributes)) {
    const accessor = (attributes as Json)[name];
    if (!document.isIndex(id) || !document.isIndex(accessor) || ids.has(id))
      return document.fail(`${path}.extensions.${DRACO}.attributes`, 'a number for each attribute', own.attributes);
    ids.set(id, accessor);
  }
  if (ids.size === 0) return document.fail(`${path}.extensions.${DRACO}.attributes`, 'POSITION', own.attributes);
  return { path, view: own.bufferView, attributes: ids, indices: indices as number | undefined };
}

/** Decodes a mesh, and adds the content of its accessors to the document. */
function decode(
  draco: Draco,
  bytes: Uint8Array,
  { path, attributes, indices }: Compressed,
  document: GltfDocument,
): void {
  const where = `${document.name}, ${path}`;
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  try {
    if (decoder.GetEncodedGeometryType(bytes) !== draco.TRIANGULAR_MESH)
      throw damaged(where, 'a mesh of Draco', 'other data');
    const status = decoder.DecodeArrayToMesh(bytes, bytes.length, mesh);
    if (!status.ok() || mesh.ptr === 0) throw damaged(where, 'a mesh of Draco', status.error_msg());
    // A primitive may decode a large mesh and show little of it by its accessors; many primitives may have one mesh.
    document.take(DECODED_BYTES * (mesh.num_faces() + mesh.num_points()));
    for (const [id, accessor] of attributes) {
      expectCount(document, accessor, mesh.num_points());
      document.provide(accessor, ...attributeOf(draco, decoder, mesh, id, accessor, document));
    }
    if (indices === undefined) return;
    expectCount(document, indices, 3 * mesh.num_faces());
    document.provide(indices, indicesOf(draco, decoder, mesh, indices, document));
  } finally {
    draco.destroy(mesh);
    draco.destroy(decoder);
  }
}

/**
 * Decodes an attribute of a mesh.
 * @returns The elements of its accessor, and the distance of elements in bytes, a multiple of 4.
 */
function attributeOf(
  draco: Draco,
  decoder: InstanceType<Draco['Decoder']>,
  mesh: DracoMesh,
  id: number,
  accessor: number,
  document: GltfDocument,
): [bytes: Uint8Array<ArrayBuffer>, stride: number] {
  const { count, componentBytes, byteLength } = layoutOf(document, accessor);
  const path = `accessors[${accessor}]`;
  const attribute = decoder.GetAttributeByUniqueId(mesh, id);
  const width = count > 0 ? byteLength / count : 0;
  const found = attribute.ptr === 0 ? 'none' : grouped(attribute.num_components() * componentBytes);
  if (count > 0 && found !== grouped(width))
    throw damaged(`${document.name}, ${path}`, `${grouped(width)} bytes an element in the mesh of Draco`, found);
  const [, type] = TYPES[document.item('accessors', accessor).componentType as keyof typeof TYPES];
  const packed = copied(draco, byteLength, document, (pointer) =>
    decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco[type], byteLength, pointer),
  );
  const stride = 4 * Math.ceil(width / 4);
  if (stride === width) return [packed, stride];
  document.take(count * stride);
  const bytes = new Uint8Array(count * stride);
  for (let i = 0; i < count; i++) bytes.set(packed.subarray(i * width, (i + 1) * width), i * stride);
  return [bytes, stride];
}

function indicesOf(
  draco: Draco,
  decoder: InstanceType<Draco['Decoder']>,
  mesh: DracoMesh,
  accessor: number,
  document: GltfDocument,
): Uint8Array<ArrayBuffer> {
  const byteLength = 4 * layoutOf(document, accessor).count;
  const packed = copied(draco, byteLength, document, (pointer) =>
    decoder.GetTrianglesUInt32Array(mesh, byteLength, pointer),
  );
  const [Integers] = TYPES[document.item('accessors', accessor).componentType as keyof typeof TYPES];
  return new Uint8Array(Integers.from(new Uint32Array(packed.buffer)).buffer);
}

/** Returns a copy of the `byteLength` bytes that `write` writes to the memory of the decoder, at a pointer. */
function copied(
  draco: Draco,
  byteLength: number,
  document: GltfDocument,
  write: (pointer: number) => boolean,
): Uint8Array<ArrayBuffer> {
  document.take(byteLength);
  const pointer = draco._malloc(byteLength);
  try {
    if (!write(pointer)) throw new Error('data of another type');
    return draco.HEAPU8.slice(pointer, pointer + byteLength);
  } finally {
    draco._free(pointer);
  }
}

function expectCount(document: GltfDocument, accessor: number, found: number): void {
  const expected = document.accessorCount(accessor);
  if (found === expected) return;
  throw new GaussianSplatError('decode/corrupt', {
    where: `${document.name}, accessors[${accessor}]`,
    expected: `${grouped(expected)} elements in the mesh of Draco`,
    found: grouped(found),
    remedy: 'export the file again; it is damaged',
  });
}
