import { isObject } from '../json.js';
import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { rootNodes } from '../gltf/nodes.js';
import { sourceOf } from './images.js';
import { withRoughness } from './materials.js';
import type { Survey } from './survey.js';

/**
 * Extensions that the glTF loader of three.js supports only if the file lists them. They are listed for all files,
 * because some files have them without listing them.
 */
const LISTED = ['KHR_materials_unlit', 'KHR_texture_transform'];

/** Maximum length of a name in characters, because three.js copies it for each channel of an animation. */
const NAME_LENGTH = 64;

/**
 * Returns the JSON of a glTF without content that its scene does not use. Only meshes and materials keep their names,
 * which picking reports.
 */
export function trimmed(document: GltfDocument, survey: Survey): Json {
  const { json } = document;
  const { meshes, materials, skins, accessors } = survey;
  const list = (name: string): unknown[] => (Array.isArray(json[name]) ? (json[name] as unknown[]) : []);
  const only = (name: string, used: ReadonlySet<number>, of: (item: Json, index: number) => Json): Json[] =>
    list(name).map((item, index) => (used.has(index) && isObject(item) ? of(item, index) : {}));
  const own = extensionsIn(json.extensions, ['KHR_lights_punctual']);
  return plain({
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: rootNodes(document) }],
    nodes: list('nodes').map((node, index) => nodeOf(isObject(node) ? node : {}, index, survey)),
    meshes: list('meshes').map((mesh, index) => {
      if (!meshes.has(index)) return { primitives: [] };
      const { name, weights } = mesh as Json;
      return {
        name: nameOf(name),
        primitives: survey.primitivesOf(index).map(primitiveOf),
        weights: weightsOf(weights, index, survey),
      };
    }),
    materials: only('materials', materials, (material) => ({
      ...withRoughness(unnamed(material)),
      name: nameOf(material.name),
    })),
    textures: list('textures').map((texture, index) =>
      isObject(texture) && hasSource(texture) ? { sampler: texture.sampler, source: sourceOf(document, index) } : {},
    ),
    samplers: list('samplers'),
    images: list('images').map(() => ({})),
    accessors: only('accessors', accessors, unnamed),
    bufferViews: list('bufferViews').map((view) => ({ byteStride: isObject(view) ? view.byteStride : undefined })),
    skins: only('skins', skins, ({ joints, inverseBindMatrices }) => ({ joints, inverseBindMatrices })),
    animations: list('animations')
      .map((animation) => animationOf(animation as Json, survey))
      .filter(({ channels }) => (channels as Json[]).length > 0),
    extensionsUsed: LISTED,
    ...(own && { extensions: own }),
  });
}

/**
 * Removes properties that are undefined from the items of all lists, because each would take 20 bytes between threads. A
 * hostile file has one for each 3 bytes.
 */
function plain(json: Json): Json {
  const defined = (item: unknown): unknown =>
    isObject(item) ? Object.fromEntries(Object.entries(item).filter(([, value]) => value !== undefined)) : item;
  const lists = Object.entries(json).map(([key, list]) => [key, Array.isArray(list) ? list.map(defined) : list]);
  return Object.fromEntries(lists) as Json;
}

const unnamed = (item: Json): Json => ({ ...item, name: undefined, extras: undefined });

const nameOf = (name: unknown): string | undefined =>
  typeof name === 'string' ? name.slice(0, NAME_LENGTH) : undefined;

const hasSource = ({ source, extensions }: Json): boolean =>
  source !== undefined ||
  (isObject(extensions) && (isObject(extensions.EXT_texture_webp) || isObject(extensions.KHR_texture_basisu)));

/**
 * Returns a node with its transform and its visible content. Nodes outside the scene keep only their transform, because
 * skins may refer to them.
 */
function nodeOf(node: Json, index: number, survey: Survey): Json {
  const { nodes, lit } = survey;
  const { matrix, translation, rotation, scale } = node;
  const place = { matrix, translation, rotation, scale };
  if (!nodes.has(index)) return place;
  const { mesh, skin, children, weights, extensions } = node;
  const names = ['EXT_mesh_gpu_instancing', ...(lit.has(index) ? ['KHR_lights_punctual'] : [])];
  const own = weightsOf(weights, mesh, survey);
  return { ...place, mesh, skin, children, weights: own, extensions: extensionsIn(extensions, names) };
}

/** Returns the weights of a mesh, one for each morph target, because three.js copies the list for each object. */
const weightsOf = (weights: unknown, mesh: unknown, survey: Survey): unknown[] | undefined =>
  Array.isArray(weights) && mesh !== undefined ? weights.slice(0, survey.targetsOf(mesh as number)) : undefined;

function primitiveOf({ attributes, indices, material, mode, targets }: Json): Json {
  return { attributes, indices, material, mode, targets };
}

function animationOf(animation: Json, survey: Survey): Json {
  return { samplers: animation.samplers, channels: survey.channelsOf(animation) };
}

function extensionsIn(extensions: unknown, names: readonly string[]): Json | undefined {
  if (!isObject(extensions)) return undefined;
  const found = names.filter((name) => extensions[name] !== undefined);
  return found.length > 0 ? Object.fromEntries(found.map((name) => [name, extensions[name]])) : undefined;
}
