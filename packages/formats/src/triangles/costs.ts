import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';

/** Charge for each draw of a primitive and for each material: shader nodes, bindings and uniforms of three.js. */
export const DRAW_BYTES = 2 ** 17;
/** Charge for each triangle of a frame: work, not memory. */
export const TRIANGLE_BYTES = 16;
/** Charge for each channel of an animation: tracks, interpolants and mixers of three.js. */
export const CHANNEL_BYTES = 4096;
/** Charge for each node that may be compared with a channel. */
export const STEP_BYTES = 8;
/** Charge for each joint of each skinned mesh: a matrix, its inverse, and their copies on the GPU. */
export const JOINT_BYTES = 256;
/** Bytes for each pixel of a texture with mipmaps. */
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

/** The validated layout of an accessor. */
export interface AccessorLayout {
  readonly count: number;
  /** Bytes of one component. */
  readonly componentBytes: number;
  /** Bytes of all elements, packed. */
  readonly byteLength: number;
}

/** Validates the numbers of an accessor. Throws `decode/header`. */
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

/** Returns the primitives of a mesh other than splats, each an object. Throws `decode/header`. */
export function trianglesOf(document: GltfDocument, mesh: unknown, isSplats: (primitive: unknown) => boolean): Json[] {
  const { primitives } = document.item('meshes', mesh);
  if (!Array.isArray(primitives)) return document.fail(`meshes[${String(mesh)}].primitives`, 'a list', primitives);
  return primitives.filter((primitive) => !isSplats(primitive)) as Json[];
}

/** Number of triangles of a primitive; points and lines count as one each. */
export function triangleCount(document: GltfDocument, { indices, attributes, mode = 4 }: Json): number {
  const { POSITION } = attributes as Json;
  const vertices = indices === undefined ? document.accessorCount(POSITION) : document.accessorCount(indices);
  return mode === 4 ? Math.floor(vertices / 3) : vertices;
}
