import { GaussianSplatError, loadModule, type GaussianCloud, type ShDegree } from '@gaussian-splat/core';
import { leftOutExtensions, openContainer, type Json } from '../gltf/container.js';
import { GltfDocument } from '../gltf/document.js';
import { multiply, placedMeshes, type Affine } from '../gltf/nodes.js';
import { activate, activationOf, isPlain, type Activation } from '../gltf/activation.js';
import { hasLinearColors, isSplats, isUncompressed, readPrimitive, shapesIn, splatsIn } from '../gltf/primitive.js';
import { grouped } from '../bytes.js';
import type { DraftCloud } from '../cloud.js';
import { addCredits, creditsOfAsset } from '../credits.js';
import { warn } from '../faults.js';
import { isObject } from '../json.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource, SplatRange } from '../scene-format.js';
import { isFar, applyMotion } from '../transform/moved-cloud.js';
import { isJsonWith } from '../signatures.js';
import { noParts } from './sog.js';

/** Transform from the axes of glTF (left, up, forward of the subject) to those of a cloud (right, down, forward). */
const TO_CLOUD: Affine = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0];

/** Bytes that are charged for each instance of a primitive, because a short file can repeat a primitive many times. */
const PRIMITIVE_BYTES = 1024;

/**
 * Reads glTF 2 and GLB with `KHR_gaussian_splatting`: the uncompressed or SPZ splats of all primitives in the default
 * scene. Transforms of nodes apply to spherical harmonics, too. Primitives may have different degrees. Other primitives,
 * cameras, lights and animations are skipped; `hints.meshes` is true if there are other primitives.
 */
export async function readGltf(source: SceneSource): Promise<GaussianCloud> {
  if (isTileset(source.bytes)) {
    const { readTiles } = await loadModule('the code that reads 3D Tiles', () => import('./tiles.js'));
    return readTiles(source);
  }
  return readSplats(source);
}

/** Whether a file is a tileset of 3D Tiles, whose JSON has an `asset` as glTF does. */
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
  addCredits(whole, creditsOfAsset(document.json.asset));
  warnDropped(whole, document.json, others > 0);
  return whole;
}

/** Encoding of documents that are read in ranges: {@link gltfSplats} requires that they match the specification. */
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

/**
 * Adds warnings about animations and unknown extensions. If the file has meshes, the code that draws them reports
 * extensions.
 */
function warnDropped(cloud: DraftCloud, json: Json, hasMeshes: boolean): void {
  if (!hasMeshes) for (const warning of leftOutExtensions(json)) warn(cloud, warning);
  const { animations } = json;
  if (Array.isArray(animations) && animations.length > 0)
    warn(cloud, `${grouped(animations.length)} animations are left out: the splats are drawn without motion.`);
}

/**
 * Returns the number of splats in a glTF, and their degree, if ranges of them can be read. Undefined if splats are
 * compressed, in another file, encoded differently from the specification, or too far away for an origin of 0.
 */
export async function gltfSplats(source: SceneSource): Promise<{ count: number; shDegree: ShDegree } | undefined> {
  const { document, placed } = open(source);
  if (
    document.hasFilesBeside ||
    document.hasPackedViews ||
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

/** An instance of a primitive of splats: its path in the JSON, and its transform to the coordinates of the scene. */
interface PlacedSplats {
  readonly primitive: Json;
  readonly path: string;
  readonly toScene: Affine;
}

/** Returns the instances of primitives with splats in the default scene, and the number of other instances. */
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

/** Primitives of a mesh with splats, and the number of its other primitives. */
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

/**
 * Returns the part of a range within the splats `at` to `at + count`, relative to `at`. If none is within, `end` is not
 * above `first`.
 */
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
