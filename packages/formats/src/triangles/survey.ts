import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { walkNodes } from '../gltf/nodes.js';
import { isSplats } from '../gltf/primitive.js';
import { isObject } from '../json.js';
import {
  DRAW_BYTES,
  JOINT_BYTES,
  layoutOf,
  MIXED_BYTES,
  scalarsIn,
  STEP_BYTES,
  TRACK_BYTES,
  TRIANGLE_BYTES,
  triangleCount,
  trianglesOf,
  VERTEX_BYTES,
} from './costs.js';

const LIGHTS = 'KHR_lights_punctual';
const INSTANCES = 'EXT_mesh_gpu_instancing';
/** Maximum number of lights, because each pixel evaluates all of them. */
const MAX_LIGHTS = 16;
/** Number of joints that may move a vertex. */
const JOINTS_PER_VERTEX = 4;
/** Types of attributes by their names; others are not drawn. */
const ATTRIBUTES: readonly (readonly [name: RegExp, types: readonly unknown[]])[] = [
  [/^(POSITION|NORMAL)$/, ['VEC3']],
  [/^(TANGENT|JOINTS_\d|WEIGHTS_\d)$/, ['VEC4']],
  [/^TEXCOORD_\d$/, ['VEC2']],
  [/^COLOR_\d$/, ['VEC3', 'VEC4']],
];
const INDEX_TYPES: readonly unknown[] = [5121, 5123, 5125];
/** Modes of primitives that are converted for three.js: closed lines, strips and fans. */
const CONVERTED_MODES: readonly unknown[] = [2, 5, 6];

/** Indices of the objects that the scene of a file uses, except splats. The constructor charges them to the budget. */
export class Survey {
  readonly nodes = new Set<number>();
  readonly meshes = new Set<number>();
  readonly materials = new Set<number>();
  readonly skins = new Set<number>();
  readonly accessors = new Set<number>();
  /** Indices of the nodes whose light is drawn, at most {@link MAX_LIGHTS}. */
  readonly lit = new Set<number>();
  /** Number of lights that exceed {@link MAX_LIGHTS} and are not drawn. */
  darkLights = 0;
  /** Number of primitives that a frame draws. */
  draws = 0;
  /** Number of triangles that a frame draws, including instances. */
  triangles = 0;
  /** Bytes of the copies of accessors that three.js makes: morph targets, instances, joints and animations. */
  copies = 0;
  readonly #document: GltfDocument;
  readonly #primitives = new Map<number, Json[]>();

  /** @throws GaussianSplatError `decode/header`, `decode/unsupported`, `out-of-memory/budget` */
  constructor(document: GltfDocument) {
    this.#document = document;
    walkNodes(document, (node, _, index) => this.#addNode(node, index));
    const { animations } = document.json;
    if (Array.isArray(animations)) for (let k = 0; k < animations.length; k++) this.#addAnimation(k);
    for (const accessor of this.accessors) this.#addAccessor(accessor);
  }

  /** Returns the channels of an animation that affect nodes of the scene. */
  channelsOf(animation: Json): Json[] {
    const channels: unknown[] = Array.isArray(animation.channels) ? animation.channels : [];
    const moves = (channel: unknown): channel is Json =>
      isObject(channel) && isObject(channel.target) && this.nodes.has(channel.target.node as number);
    return channels.filter(moves);
  }

  /** Returns the primitives of a mesh other than splats, by the index of the mesh. */
  primitivesOf(mesh: number): Json[] {
    const known = this.#primitives.get(mesh) ?? trianglesOf(this.#document, mesh, isSplats);
    this.#primitives.set(mesh, known);
    return known;
  }

  /** Returns the largest number of morph targets of the primitives of a mesh. */
  targetsOf(mesh: number): number {
    return this.primitivesOf(mesh).reduce((max, { targets }) => Math.max(max, listOf(targets).length), 0);
  }

  #addNode(node: Json, index: number): void {
    const document = this.#document;
    const { mesh, skin, extensions } = node;
    if (this.nodes.has(index)) document.fail(`nodes[${index}]`, 'one parent', 'several');
    this.nodes.add(index);
    if (isObject(extensions) && extensions[LIGHTS] !== undefined) {
      if (this.lit.size < MAX_LIGHTS) this.lit.add(index);
      else this.darkLights++;
    }
    if (mesh === undefined) return;
    if (!document.isIndex(mesh)) return document.fail(`nodes[${index}].mesh`, 'a whole number', mesh);
    const primitives = this.primitivesOf(mesh);
    const instances = isObject(extensions) ? this.#instancesOf(extensions[INSTANCES], index, primitives.length) : 1;
    const isNew = !this.meshes.has(mesh);
    this.meshes.add(mesh);
    this.draws += primitives.length;
    document.take(DRAW_BYTES * primitives.length);
    for (const [k, primitive] of primitives.entries()) {
      const path = `meshes[${mesh}].primitives[${k}]`;
      if (isNew) this.#addPrimitive(primitive, path);
      const triangles = instances * triangleCount(document, primitive);
      this.triangles += triangles;
      const targets = listOf(primitive.targets).length;
      const steps = 1 + targets + (skin === undefined ? 0 : JOINTS_PER_VERTEX);
      const vertices = document.accessorCount((primitive.attributes as Json).POSITION);
      document.take(TRIANGLE_BYTES * triangles + VERTEX_BYTES * vertices * steps);
      this.#copy(16 * targets);
    }
    if (skin !== undefined && primitives.length > 0) this.#addSkin(skin);
  }

  #addPrimitive(primitive: Json, path: string): void {
    const document = this.#document;
    if (!isObject(primitive) || !isObject(primitive.attributes))
      return document.fail(path, 'a primitive with attributes', primitive);
    const { attributes, indices, material, targets, extensions, mode } = primitive;
    if (
      isObject(extensions) &&
      extensions.KHR_draco_mesh_compression !== undefined &&
      attributes.POSITION === undefined
    )
      document.fail(path, 'attributes', 'none');
    const { count } = layoutOf(document, attributes.POSITION);
    for (const [name, accessor] of Object.entries(attributes)) {
      this.#use(accessor);
      this.#checkAttribute(name, accessor, count, path);
    }
    // Three indices for each vertex, in a list of numbers and in an array.
    if (CONVERTED_MODES.includes(mode)) this.#copy(3 * (8 + 4) * triangleCount(document, primitive));
    if (indices !== undefined) {
      this.#use(indices);
      const { componentType, type } = document.item('accessors', indices);
      if (type !== 'SCALAR' || !INDEX_TYPES.includes(componentType))
        document.fail(`${path}.indices`, 'whole numbers', { componentType, type });
    }
    if (material !== undefined) {
      if (!this.materials.has(material as number)) document.take(DRAW_BYTES);
      document.item('materials', material);
      this.materials.add(material as number);
    }
    const names = new Set<string>();
    for (const target of listOf(targets)) {
      if (!isObject(target)) return document.fail(`${path}.targets`, 'a list of objects', targets);
      for (const [name, accessor] of Object.entries(target)) {
        names.add(name);
        this.#use(accessor);
      }
    }
    // All morph targets of a primitive are one texture, in CPU and in GPU memory.
    this.#copy(2 * 16 * count * names.size * listOf(targets).length);
  }

  /** Checks that an attribute is drawable and has an element for each of `count` vertices. */
  #checkAttribute(name: string, accessor: unknown, count: number, path: string): void {
    const [, types] = ATTRIBUTES.find(([names]) => names.test(name)) ?? [];
    const { type, count: own } = this.#document.item('accessors', accessor);
    if (types && (!types.includes(type) || own !== count))
      this.#document.fail(`${path}.attributes.${name}`, `${count} of ${types.join(' or ')}`, { type, count: own });
  }

  /** Returns the number of instances of a node's mesh, 1 or more, and charges them for each of its `draws`. */
  #instancesOf(extension: unknown, node: number, draws: number): number {
    if (!isObject(extension)) return 1;
    const { attributes } = extension;
    if (!isObject(attributes))
      return this.#document.fail(`nodes[${node}].extensions.${INSTANCES}`, 'attributes', extension);
    const counts = Object.values(attributes).map((accessor) => {
      this.#use(accessor);
      return this.#document.accessorCount(accessor);
    });
    const count = Math.max(1, ...counts);
    // Each instance of a draw has a matrix of 64 bytes in CPU and in GPU memory.
    this.#copy(2 * 64 * count * draws);
    return count;
  }

  #addSkin(index: unknown): void {
    const skin = this.#document.item('skins', index);
    this.skins.add(index as number);
    if (skin.inverseBindMatrices !== undefined) this.#use(skin.inverseBindMatrices);
    this.#copy(JOINT_BYTES * listOf(skin.joints).length);
  }

  #addAnimation(index: number): void {
    const document = this.#document;
    const animation = document.item('animations', index);
    const samplers = listOf(animation.samplers);
    for (const channel of this.channelsOf(animation)) {
      const sampler = samplers[channel.sampler as number];
      if (!isObject(sampler)) return document.fail(`animations[${index}]`, 'a sampler for each channel', channel);
      const [times, values] = [sampler.input, sampler.output].map((accessor) => {
        this.#use(accessor);
        return layoutOf(document, accessor);
      });
      const tracks = this.#tracksOf(channel.target as Json);
      document.take(tracks * (TRACK_BYTES + STEP_BYTES * this.nodes.size));
      // Each track may convert times and values to float32, after values are converted once for the channel.
      const scalars = scalarsIn(values);
      this.#copy(4 * scalars + tracks * 4 * (scalarsIn(times) + scalars));
      this.#copy((tracks * MIXED_BYTES * scalars) / Math.max(1, times.count));
    }
  }

  /** Returns the maximum number of tracks of a channel: one for each morphed object at the node and directly below. */
  #tracksOf({ node, path }: Json): number {
    if (path !== 'weights') return 1;
    const { mesh, children } = this.#document.item('nodes', node);
    return 1 + (mesh === undefined ? 0 : this.primitivesOf(mesh as number).length) + listOf(children).length;
  }

  #use(accessor: unknown): void {
    this.#document.item('accessors', accessor);
    this.accessors.add(accessor as number);
  }

  /** Charges an accessor for the memory of the CPU and of the GPU. */
  #addAccessor(index: number): void {
    this.#document.take(2 * layoutOf(this.#document, index).byteLength);
  }

  #copy(bytes: number): void {
    this.copies += bytes;
    this.#document.take(bytes);
  }
}

const listOf = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);
