import { GaussianSplatError, loadModule, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { openContainer, unknownExtensions, type Json } from '../gltf/container.js';
import { GltfDocument } from '../gltf/document.js';
import { multiply, placedMeshes, type Affine } from '../gltf/nodes.js';
import { activate, activationOf, isPlain, type Activation } from '../gltf/activation.js';
import { hasLinearColors, isSplats, isUncompressed, readPrimitive, shapesIn, splatsIn } from '../gltf/primitive.js';
import { grouped } from '../bytes.js';
import type { DraftCloud } from '../cloud.js';
import { warn } from '../faults.js';
import { isObject } from '../json.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource, SplatRange } from '../scene-format.js';
import { isFar, applyMotion } from '../transform/moved-cloud.js';
import { isJsonWith } from '../signatures.js';
import { noParts } from './sog.js';

/** glTF's axes are left, up and forward of the subject; a cloud's are right, down and forward. */
const TO_CLOUD: Affine = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0];

/** Charge for each instance of a primitive of splats, because a short file can repeat the same ones many times. */
const PRIMITIVE_BYTES = 1024;

/**
 * Reads glTF 2 and GLB with `KHR_gaussian_splatting`: all primitives with splats of the default scene, each transformed
 * by its nodes (including spherical harmonics), uncompressed or as SPZ. Degrees may differ. Meshes and points without
 * the extension, cameras, lights and animations are skipped; `hints.meshes` reports the presence of meshes.
 */
export async function readGltf(source: SceneSource): Promise<GaussianCloud> {
  if (isTileset(source.bytes)) {
    const { readTiles } = await loadModule('the code that reads 3D Tiles', () => import('./tiles.js'));
    return readTiles(source);
  }
  return readSplats(source);
}

/** The JSON of 3D Tiles has an asset, too. */
export const isTileset = isJsonWith(/"geometricError"\s*:/);

async function readSplats(source: SceneSource): Promise<GaussianCloud> {
  const { name, signal, range } = source;
  const { document, placed, others } = open(source);
  if (placed.length === 0) throw noSplats(document.json, name, others);
  const found: (PlacedSplats & { readonly cloud: DraftCloud })[] = [];
  let splats = 0;
  for (const one of placed) {
    const { primitive, path } = one;
    signal?.throwIfAborted();
    const own = range && within(range, splats, splatsIn(document, primitive, path).count);
    if (own && own.end <= own.first) {
      splats += own.count;
      continue;
    }
    const cloud = await readPrimitive(document, primitive, path, source, own);
    splats += own?.count ?? cloud.count;
    found.push({ ...one, cloud });
  }
  const activation = range ? PLAIN : activationOf(document.json, openCloudsOf(found));
  const clouds: GaussianCloud[] = [];
  for (const { cloud, primitive, toScene } of found) {
    signal?.throwIfAborted();
    const isOpen = isUncompressed(primitive);
    if (isOpen) activate(cloud, activation);
    if (hasLinearColors(primitive)) await encodeColors(cloud);
    const inScene = multiply(TO_CLOUD, toScene);
    clouds.push(applyMotion(cloud, isOpen && activation.isInPlyFrame ? multiply(inScene, TO_CLOUD) : inScene));
  }
  const whole =
    clouds.length === 1
      ? { ...clouds[0] }
      : mergeClouds(
          clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
          source,
        );
  if (others > 0) whole.hints = { ...whole.hints, meshes: true };
  warnDropped(whole, document.json, others > 0);
  return whole;
}

/** Ranges are offered only for documents that match the specification: see {@link gltfSplats}. */
const PLAIN: Activation = { hasLogarithms: false, hasLogits: false, isInPlyFrame: false };

const openCloudsOf = (found: readonly (PlacedSplats & { readonly cloud: GaussianCloud })[]): GaussianCloud[] =>
  found.filter(({ primitive }) => isUncompressed(primitive)).map(({ cloud }) => cloud);

async function encodeColors(cloud: DraftCloud): Promise<void> {
  const { encodeLinearColors } = await loadModule(
    'the code that encodes linear colors',
    () => import('../linear-colors.js'),
  );
  encodeLinearColors(cloud, 'lin_rec709_display');
}

/** Maximum number of extensions in a message. */
const MAX_NAMED = 6;

/** Warns of content that is not drawn. Other warnings of a file with meshes are left to the code that draws these. */
function warnDropped(cloud: DraftCloud, json: Json, hasMeshes: boolean): void {
  const unknown = hasMeshes ? [] : unknownExtensions(json);
  const named = unknown.slice(0, MAX_NAMED).map((extension) => extension.slice(0, 80));
  if (unknown.length > 0) warn(cloud, `Extensions of glTF that are not known are left out: ${named.join(', ')}.`);
  const { animations } = json;
  if (Array.isArray(animations) && animations.length > 0)
    warn(cloud, `${grouped(animations.length)} animations are left out for splats: they are drawn as they stand.`);
}

/**
 * Returns the number of splats in a glTF, and their degree; undefined if they cannot be read in ranges: because they
 * are compressed, in another file, encoded differently from the specification, or far enough away to need their own
 * origin.
 */
export async function gltfSplats(source: SceneSource): Promise<{ count: number; shDegree: ShDegree } | undefined> {
  const { document, placed } = open(source);
  if (
    document.hasFilesBeside ||
    !placed.every(({ primitive, toScene }) => isUncompressed(primitive) && !isFar(toScene))
  )
    return undefined;
  const numbers = await Promise.all(placed.map(({ primitive, path }) => shapesIn(document, primitive, path)));
  if (!isPlain(activationOf(document.json, numbers))) return undefined;
  const found = placed.map(({ primitive, path }) => splatsIn(document, primitive, path));
  const count = found.reduce((sum, own) => sum + own.count, 0);
  const shDegree = found.reduce<ShDegree>((max, own) => (own.shDegree > max ? own.shDegree : max), 0);
  return { count, shDegree };
}

/** Splats with their transform in the scene, and their location in the file. */
interface PlacedSplats {
  readonly primitive: Json;
  readonly path: string;
  readonly toScene: Affine;
}

/** Returns the primitives with splats of the default scene in order, and the number of others. */
function open({ bytes, name, openFile, budget }: SceneSource): {
  document: GltfDocument;
  placed: PlacedSplats[];
  others: number;
} {
  const document = new GltfDocument(
    openContainer({ bytes, name, budget }),
    { name, budget },
    { part: openFile ?? noParts(name, 'scene.glb') },
  );
  const placed: PlacedSplats[] = [];
  const known = new Map<number, MeshParts>();
  let others = 0;
  for (const { mesh, toScene } of placedMeshes(document)) {
    const parts = known.get(mesh) ?? partsOf(document, mesh);
    known.set(mesh, parts);
    others += parts.others;
    budget.take(PRIMITIVE_BYTES * parts.splats.length, name);
    for (const splats of parts.splats) placed.push({ ...splats, toScene });
  }
  return { document, placed, others };
}

/** Primitives of a mesh. */
interface MeshParts {
  readonly splats: readonly Omit<PlacedSplats, 'toScene'>[];
  readonly others: number;
}

function partsOf(document: GltfDocument, mesh: number): MeshParts {
  const { primitives } = document.item('meshes', mesh);
  if (!Array.isArray(primitives)) return document.fail(`meshes[${mesh}].primitives`, 'a list', primitives);
  const splats = primitives.flatMap((primitive: unknown, k) =>
    isSplats(primitive) ? { primitive, path: `meshes[${mesh}].primitives[${k}]` } : [],
  );
  return { splats, others: primitives.length - splats.length };
}

/** Intersects a range with `count` splats from index `at` on; the result is relative to `at`. */
function within({ first, end }: SplatRange, at: number, count: number): SplatRange & { count: number } {
  return { first: Math.max(0, first - at), end: Math.min(count, end - at), count };
}

function noSplats({ meshes }: Json, name: string, others: number): GaussianSplatError {
  const all: unknown[] = Array.isArray(meshes) ? meshes : [];
  const hidden = all.flatMap((mesh) => (isObject(mesh) ? mesh.primitives : [])).filter(isSplats).length;
  return new GaussianSplatError('decode/not-splats', {
    where: name,
    expected: 'glTF with splats (the extension KHR_gaussian_splatting) in its scene',
    found:
      hidden > 0
        ? `${hidden} primitive${hidden > 1 ? 's' : ''} of splats that the scene does not show`
        : `${all.length} meshes, and ${others} primitives of other kinds in the scene`,
    remedy:
      hidden > 0
        ? 'name the scene that shows them in "scene", or put their node into the one that is named'
        : 'show meshes with <splat-mesh src> in a <gaussian-splat>, or export the scene with KHR_gaussian_splatting',
  });
}
