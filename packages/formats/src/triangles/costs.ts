import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';

/** Bytes charged for each draw of a primitive and for each material: shader nodes, bindings, uniforms of three.js. */
export const DRAW_BYTES = 2 ** 17;
/** Bytes charged for each triangle of a frame, to bound the work of drawing. */
export const TRIANGLE_BYTES = 16;
/**
 * Bytes charged for each vertex of a draw, for each of its morph targets, and for each joint that may move it. The
 * main thread computes the bounds of a model from all vertices.
 */
export const VERTEX_BYTES = 16;
/** Bytes charged for each track of an animation: interpolants and mixers of three.js. */
export const TRACK_BYTES = 4096;
/** Bytes charged for each pair of a track and a node, because three.js searches the node of a track. */
export const STEP_BYTES = 8;
/** Bytes charged for each number that a track sets in a frame: buffers of interpolants and mixers. */
export const MIXED_BYTES = 64;
/** Bytes charged for each joint of each skinned mesh: a matrix, its inverse, and their copies on the GPU. */
export const JOINT_BYTES = 256;
/** Bytes of GPU memory for each pixel of a texture with mipmaps. */
export const TEXEL_BYTES = (4 * 4) / 3;

const COMPONENT_BYTES: ReadonlyMap<unknown, number> = new Map([
  [5120, 1],
  [5121, 1],
  [5122, 2],
  [5123, 2],
  [5125, 4],
  [5126, 4],
]);
const TYPE_WIDTHS: ReadonlyMap<unknown, number> = new Map([
  ['SCALAR', 1],
  ['VEC2', 2],
  ['VEC3', 3],
  ['VEC4', 4],
  ['MAT2', 4],
  ['MAT3', 9],
  ['MAT4', 16],
]);

/** Sizes of an accessor whose component type, type and count are valid. */
export interface AccessorLayout {
  readonly count: number;
  /** Size of a component in bytes. */
  readonly componentBytes: number;
  /** Size of all elements in bytes, packed. */
  readonly byteLength: number;
}

/** Returns the layout of an accessor, by its index. Throws `decode/header` for invalid types or counts. */
export function layoutOf(document: GltfDocument, index: unknown): AccessorLayout {
  const accessor = document.item('accessors', index);
  const path = `accessors[${String(index)}]`;
  const componentBytes =
    COMPONENT_BYTES.get(accessor.componentType) ??
    document.fail(`${path}.componentType`, '5120 to 5126', accessor.componentType);
  const width = TYPE_WIDTHS.get(accessor.type) ?? document.fail(`${path}.type`, 'SCALAR to MAT4', accessor.type);
  const count = document.accessorCount(index);
  return { count, componentBytes, byteLength: count * width * componentBytes };
}

/** Returns the number of scalars in all elements of an accessor. */
export const scalarsIn = ({ byteLength, componentBytes }: AccessorLayout): number => byteLength / componentBytes;

/** Returns the primitives of a mesh other than splats. Throws `decode/header` if the mesh has no list of primitives. */
export function trianglesOf(document: GltfDocument, mesh: unknown, isSplats: (primitive: unknown) => boolean): Json[] {
  const { primitives } = document.item('meshes', mesh);
  if (!Array.isArray(primitives)) return document.fail(`meshes[${String(mesh)}].primitives`, 'a list', primitives);
  return primitives.filter((primitive) => !isSplats(primitive)) as Json[];
}

/** Returns the number of triangles of a primitive. In other modes, each vertex or index counts as a triangle. */
export function triangleCount(document: GltfDocument, { indices, attributes, mode = 4 }: Json): number {
  const { POSITION } = attributes as Json;
  const vertices = indices === undefined ? document.accessorCount(POSITION) : document.accessorCount(indices);
  return mode === 4 ? Math.floor(vertices / 3) : vertices;
}
