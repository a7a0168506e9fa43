import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { walkNodes } from '../gltf/nodes.js';
import { isSplats } from '../gltf/primitive.js';
import { isObject } from '../json.js';
import {
  CHANNEL_BYTES,
  DRAW_BYTES,
  JOINT_BYTES,
  layoutOf,
  STEP_BYTES,
  TRIANGLE_BYTES,
  triangleCount,
  trianglesOf,
} from './costs.js';

const LIGHTS = 'KHR_lights_punctual';
const INSTANCES = 'EXT_mesh_gpu_instancing';
/** Maximum number of lights, because each pixel evaluates all of them. */
const MAX_LIGHTS = 16;

/** The parts of a file that its scene uses, except splats. All of them are charged to the budget. */
export class Survey {
  readonly nodes = new Set<number>();
  readonly meshes = new Set<number>();
  readonly materials = new Set<number>();
  readonly skins = new Set<number>();
  readonly accessors = new Set<number>();
  /** Nodes whose light is used. */
  readonly lit = new Set<number>();
  /** Number of lights that are not used. */
  darkLights = 0;
  /** Primitives drawn in a frame, and their triangles. */
  draws = 0;
  triangles = 0;
  /** Bytes of accessor copies: morph targets, instances, joints. */
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

  /** Channels of an animation that affect nodes of the scene. */
  channelsOf(animation: Json): Json[] {
    const channels: unknown[] = Array.isArray(animation.channels) ? animation.channels : [];
    const moves = (channel: unknown): channel is Json =>
      isObject(channel) && isObject(channel.target) && this.nodes.has(channel.target.node as number);
    return channels.filter(moves);
  }

  /** Primitives of a mesh other than splats. */
  primitivesOf(mesh: number): Json[] {
    const known = this.#primitives.get(mesh) ?? trianglesOf(this.#document, mesh, isSplats);
    this.#primitives.set(mesh, known);
    return known;
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
    const instances = isObject(extensions) ? this.#instancesOf(extensions[INSTANCES], index) : 1;
    const primitives = this.primitivesOf(mesh);
    const isNew = !this.meshes.has(mesh);
    this.meshes.add(mesh);
    this.draws += primitives.length;
    document.take(DRAW_BYTES * primitives.length);
    for (const [k, primitive] of primitives.entries()) {
      const path = `meshes[${mesh}].primitives[${k}]`;
      if (isNew) this.#addPrimitive(primitive, path);
      const triangles = instances * triangleCount(document, primitive);
      this.triangles += triangles;
      document.take(TRIANGLE_BYTES * triangles);
      this.#copy(16 * listOf(primitive.targets).length);
    }
    if (skin !== undefined && primitives.length > 0) this.#addSkin(skin);
  }

  #addPrimitive(primitive: Json, path: string): void {
    const document = this.#document;
    if (!isObject(primitive) || !isObject(primitive.attributes))
      return document.fail(path, 'a primitive with attributes', primitive);
    const { attributes, indices, material, targets, extensions } = primitive;
    if (
      isObject(extensions) &&
      extensions.KHR_draco_mesh_compression !== undefined &&
      attributes.POSITION === undefined
    )
      document.fail(path, 'attributes', 'none');
    for (const accessor of Object.values(attributes)) this.#use(accessor);
    const { count } = layoutOf(document, attributes.POSITION);
    if (indices !== undefined) this.#use(indices);
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

  /** Instances of a node's mesh. */
  #instancesOf(extension: unknown, node: number): number {
    if (!isObject(extension)) return 1;
    const { attributes } = extension;
    if (!isObject(attributes))
      return this.#document.fail(`nodes[${node}].extensions.${INSTANCES}`, 'attributes', extension);
    const counts = Object.values(attributes).map((accessor) => {
      this.#use(accessor);
      return this.#document.accessorCount(accessor);
    });
    const count = Math.max(1, ...counts);
    // A matrix each, in CPU and in GPU memory.
    this.#copy(2 * 64 * count);
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
      document.take(CHANNEL_BYTES + STEP_BYTES * this.nodes.size);
      const sampler = samplers[channel.sampler as number];
      if (!isObject(sampler)) return document.fail(`animations[${index}]`, 'a sampler for each channel', channel);
      this.#use(sampler.input);
      this.#use(sampler.output);
      const { byteLength } = layoutOf(document, sampler.output);
      // Weights are copied for each primitive of the mesh.
      const { mesh } = document.item('nodes', (channel.target as Json).node);
      const copies = mesh === undefined ? 1 : Math.max(1, this.primitivesOf(mesh as number).length);
      this.#copy(4 * byteLength * copies);
    }
  }

  #use(accessor: unknown): void {
    this.#document.item('accessors', accessor);
    this.accessors.add(accessor as number);
  }

  /** Charged for the CPU and for the GPU. */
  #addAccessor(index: number): void {
    this.#document.take(2 * layoutOf(this.#document, index).byteLength);
  }

  #copy(bytes: number): void {
    this.copies += bytes;
    this.#document.take(bytes);
  }
}

const listOf = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);
