import { GaussianSplatError } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { PLAIN } from '../ply/gaussian-layout.js';
import { parsePlyHeader, type PlyElement, type PlyHeader, type PlyProperty } from '../ply/header.js';
import { cursorAt, openElement, readColumns, skipList, type ColumnTarget, type ElementData } from '../ply/rows.js';
import type { SceneSource } from '../scene-format.js';
import { DRAW_BYTES, TRIANGLE_BYTES } from './costs.js';
import type { TriangleFile, TriangleSource } from './read-triangles.js';

/** Names of the properties of an attribute. Each column of the attribute has a list of alternative names. */
const POSITION = [['x'], ['y'], ['z']];
const NORMAL = [['nx'], ['ny'], ['nz']];
const COLOR = [
  ['red', 'diffuse_red', 'r'],
  ['green', 'diffuse_green', 'g'],
  ['blue', 'diffuse_blue', 'b'],
];
const ALPHA = ['alpha', 'diffuse_alpha', 'a'];
const UV = [
  ['s', 'u', 'texture_u', 'texture_s'],
  ['t', 'v', 'texture_v', 'texture_t'],
];
const CORNERS = ['vertex_indices', 'vertex_index'];
const [FLOAT, UNSIGNED_SHORT, UNSIGNED_INT] = [5126, 5123, 5125];

/** An attribute or the indices of the mesh: the bytes and the JSON of a glTF accessor. */
interface Accessor {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly json: Readonly<Record<string, unknown>>;
}

/**
 * Converts a PLY file with faces to glTF: positions, normals, colors, and polygons as triangle fans. Vertices and
 * triangles are charged to the budget before they are allocated.
 * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`
 */
export function readPlyMesh({ bytes, name, budget }: TriangleSource): TriangleFile {
  const source: SceneSource = { bytes, name, budget };
  const header = parsePlyHeader(source);
  const [vertex, face] = ['vertex', 'face'].map((wanted) => header.elements.find((element) => element.name === wanted));
  const list = face?.properties.find(({ name: own, listCountType }) => listCountType && CORNERS.includes(own));
  if (!vertex || !face || !list || !namesIn(vertex, POSITION)) throw noFaces(name, header);
  const data = openElement(source, header, 'vertex');
  const [positions, colors, normals] = [POSITION, COLOR, NORMAL].map((names) => columnsOf(data, names, source));
  const indices = trianglesOf(openElement(source, header, 'face'), list, positions!, source);
  if (indices.length === 0) throw noFaces(name, header);
  budget.take(DRAW_BYTES, name);
  const alpha = colors && columnsOf(data, [ALPHA], source);
  const attributes: Record<string, Accessor> = { POSITION: positionsOf(positions!) };
  if (normals) attributes.NORMAL = floats(normals);
  if (colors) attributes.COLOR_0 = colorsOf(colors, alpha, vertex);
  const all = [
    ...Object.values(attributes),
    { bytes: bytesOf(indices), json: { componentType: UNSIGNED_INT, count: indices.length, type: 'SCALAR' } },
  ];
  return {
    json: documentOf(Object.keys(attributes), all, alpha !== undefined),
    views: all.map((accessor) => accessor.bytes),
    images: [],
    byteLength: all.reduce((sum, accessor) => sum + accessor.bytes.length, 0),
    triangles: indices.length / 3,
    warnings: namesIn(vertex, UV) || header.comments.some((line) => /^TextureFile\b/i.test(line)) ? [NO_TEXTURE] : [],
  };
}

const NO_TEXTURE = 'The texture of a PLY mesh is not shown; export the mesh as GLB to have it.';

/** Returns the name of each column in an element; undefined if a column is missing. */
function namesIn({ properties }: PlyElement, columns: readonly (readonly string[])[]): string[] | undefined {
  const found = columns.map(
    (names) => properties.find((each) => names.includes(each.name) && !each.listCountType)?.name,
  );
  return found.includes(undefined) ? undefined : (found as string[]);
}

/** Reads columns of all vertices, [vertices, columns]; undefined if a column is missing. */
function columnsOf(
  data: ElementData,
  columns: readonly (readonly string[])[],
  source: SceneSource,
): Float32Array<ArrayBuffer> | undefined {
  const names = namesIn(data.element, columns);
  if (!names) return undefined;
  const stride = names.length;
  // The charge includes the memory of the CPU and of the GPU.
  source.budget?.take(8 * stride * data.element.count, source.name);
  const array = new Float32Array(stride * data.element.count);
  readColumns(
    data,
    names.map((property, offset): ColumnTarget => ({ property, array, stride, offset })),
  );
  return array;
}

/** Returns the vertex indices of the triangle fans of all faces, [triangles, 3]. Triangles without finite positions are dropped. */
function trianglesOf(
  data: ElementData,
  list: PlyProperty,
  positions: Float32Array,
  source: SceneSource,
): Uint32Array<ArrayBuffer> {
  const count = positions.length / 3;
  const isPlaced = (i: number): boolean =>
    Number.isFinite(positions[3 * i] + positions[3 * i + 1] + positions[3 * i + 2]);
  const cursor = cursorAt(data);
  let corners = new Uint32Array(0);
  let used = 0;
  const add = (a: number, b: number, c: number): void => {
    if (used + 3 > corners.length) {
      const length = Math.max(3 * data.element.count, 2 * corners.length);
      source.budget?.take(8 * length + (TRIANGLE_BYTES * (length - corners.length)) / 3, source.name);
      const grown = new Uint32Array(length);
      grown.set(corners);
      corners = grown;
    }
    corners[used++] = a;
    corners[used++] = b;
    corners[used++] = c;
  };
  for (let row = 0; row < data.element.count; row++) {
    for (const { name, type, listCountType } of data.element.properties) {
      if (name !== list.name) {
        if (listCountType) skipList(data, cursor, name, listCountType, type);
        else cursor.skip(type, 1);
        continue;
      }
      const sides = cursor.next(list.listCountType!);
      let [first, last] = [-1, -1];
      for (let k = 0; k < sides && !cursor.ended; k++) {
        const corner = cursor.next(list.type);
        if (cursor.ended) break;
        if (!(corner >= 0 && corner < count && Number.isInteger(corner)))
          throw damaged(
            `${source.name}, face ${grouped(row)}`,
            `a vertex from 0 to ${grouped(count - 1)}`,
            String(corner),
          );
        if (k === 0) first = corner;
        else if (k > 1 && isPlaced(first) && isPlaced(last) && isPlaced(corner)) add(first, last, corner);
        last = corner;
      }
    }
    if (cursor.ended)
      throw damaged(source.name, `${grouped(data.element.count)} faces`, grouped(row), 'decode/truncated');
  }
  return corners.slice(0, used);
}

function positionsOf(positions: Float32Array<ArrayBuffer>): Accessor {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (let at = 0; at < positions.length; at++) {
    // No triangle uses a vertex with a coordinate that is not finite.
    if (!Number.isFinite(positions[at])) positions[at] = 0;
    min[at % 3] = Math.min(min[at % 3], positions[at]);
    max[at % 3] = Math.max(max[at % 3], positions[at]);
  }
  const { bytes, json } = floats(positions);
  return { bytes, json: { ...json, min, max } };
}

const floats = (array: Float32Array<ArrayBuffer>): Accessor => ({
  bytes: bytesOf(array),
  json: { componentType: FLOAT, count: array.length / 3, type: 'VEC3' },
});

/** Converts sRGB colors, [vertices, 3], to an accessor of linear colors with alpha, as glTF specifies. */
function colorsOf(colors: Float32Array, alpha: Float32Array | undefined, { properties }: PlyElement): Accessor {
  const type = properties.find(({ name }) => COLOR[0].includes(name))!.type;
  const max = { uint8: 255, uint16: 65_535, int32: 255, uint32: 255 }[type as string] ?? 1;
  const count = colors.length / 3;
  const linear = new Uint16Array(4 * count);
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) linear[4 * i + k] = Math.round(65_535 * linearOf(unit(colors[3 * i + k] / max)));
    linear[4 * i + 3] = alpha ? Math.round(65_535 * unit(alpha[i] / max)) : 65_535;
  }
  return { bytes: bytesOf(linear), json: { componentType: UNSIGNED_SHORT, normalized: true, count, type: 'VEC4' } };
}

const unit = (value: number): number => Math.min(1, Math.max(0, value || 0));
const linearOf = (value: number): number => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
const bytesOf = ({ buffer }: { readonly buffer: ArrayBuffer }): Uint8Array<ArrayBuffer> => new Uint8Array(buffer);

/** Returns the JSON of a glTF with one mesh. Accessor k has buffer view k; the last accessor has the indices. */
function documentOf(names: readonly string[], accessors: readonly Accessor[], hasAlpha: boolean): TriangleFile['json'] {
  const attributes = Object.fromEntries(names.map((name, index) => [name, index]));
  return {
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes, indices: names.length, material: 0 }] }],
    // Double-sided, because scanned surfaces have no hidden inside.
    materials: [
      { pbrMetallicRoughness: { metallicFactor: 0 }, doubleSided: true, ...(hasAlpha && { alphaMode: 'BLEND' }) },
    ],
    accessors: accessors.map(({ json }, bufferView) => ({ ...json, bufferView })),
    bufferViews: accessors.map(({ bytes }) => ({ byteLength: bytes.length })),
  };
}

function noFaces(where: string, { elements }: PlyHeader): GaussianSplatError {
  return new GaussianSplatError('decode/empty', {
    where,
    expected: 'vertices with x, y and z, and faces with vertex_indices',
    found:
      elements
        .map(({ name, count }) => `${grouped(count)} ${name}`.slice(0, 60))
        .slice(0, 8)
        .join(', ') || 'no elements',
    remedy: isSplats(elements) ? 'show splats by src of <gaussian-splat>' : 'export a mesh with faces',
  });
}

const isSplats = (elements: readonly PlyElement[]): boolean =>
  elements.some(({ properties }) => properties.some(({ name }) => /_/.test(name) && PLAIN.test(name)));
