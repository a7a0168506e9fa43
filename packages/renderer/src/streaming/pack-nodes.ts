import type { GaussianCloud } from '@gaussian-splat/core';
import { mortonOrder } from '../pack/morton.js';
import { usableIndices } from '../pack/pack.js';
import { CHUNK_NUMBERS } from '../pack/words.js';
import { placedIn } from './level-source.js';
import { joinSlots, packRun, type PackedRun } from './pack-run.js';
import type { StreamedScene } from './page-source.js';
import { BOX_NUMBERS, MAX_SPLATS, type NodePacker } from './node-packer.js';
import { CELL_ERROR, spacingBetween, spacingOf } from './run-errors.js';

/** A node of a tree of levels, with its splats. */
export interface NodeContent {
  /** Splats of the node; absent if it has none. */
  readonly cloud?: GaussianCloud | undefined;
  /**
   * Volume of each child, with all nodes below it: center, three half axes, and radius of a sphere around it, in world
   * units, [13]. Undefined if it is unknown.
   */
  readonly volumes: readonly (readonly number[] | undefined)[];
  /**
   * Number of splats that each child replaces, in the order of {@link cloud}; the remaining splats have no child. If
   * absent, the splats are divided by {@link volumes}.
   */
  readonly parts?: readonly number[] | undefined;
  /** Whether the node is drawn in addition to its children, instead of being replaced by them. */
  readonly isAdded: boolean;
  /** Maximum error in world units of the node without its children; Infinity if the file does not declare it. */
  readonly error: number;
}

/** Sphere (center and radius, relative to the origin of the scene) and error of a run, world units, [5]. */
export type RunError = readonly number[];

/** A page of one or more nodes. Plain data with a transferable buffer, so that a worker can pack it. */
export interface NodePage {
  /** Chunks slot by slot, in the layout of docs/lod-format.md. */
  readonly words: Uint32Array<ArrayBuffer>;
  /** Number of chunks that each child replaces. These runs are consecutive and begin with the first chunk. */
  readonly runs: readonly number[];
  /** Sphere and error of each of these runs. */
  readonly errors: readonly RunError[];
  /** Number of splats in each of these runs. */
  readonly counts: readonly number[];
  /** Number of splats in the page. */
  readonly splats: number;
}

/** Ratio of the value of the run above to the maximum below it. It exceeds the rounding error of float32. */
const STRICTLY = 1.001;
/** Minimum fraction of its radius that a sphere keeps when it shrinks to be inside the sphere above it. */
const MIN_SHRINK = 0.5;

/**
 * Packs nodes as a page. The splats of a node are divided among its children by their volumes, so that each child is a
 * page that replaces its own part. An empty chunk stands for a child without splats to replace, such as those of a node
 * that is drawn in addition to its children.
 *
 * The error of a run is estimated by the spacing of its splats, because the splats of the child are unknown. A
 * declared error bounds it. Spheres and errors are within those of the run that the page replaces, so that screen errors
 * decrease from level to level.
 * @param above The run that the page replaces; undefined for the first page.
 * @param code WebAssembly that packs several times as fast, to the same words. Scenes of other geometry, and large nodes, do without.
 */
export function packNodes(
  nodes: readonly NodeContent[],
  scene: StreamedScene,
  above?: RunError,
  code?: NodePacker,
): NodePage {
  const replaced: PackedRun[] = [];
  const drawn: PackedRun[] = [];
  const counts: number[] = [];
  let splats = 0;
  for (const { cloud, volumes, parts: given, isAdded, error } of nodes) {
    const placed = cloud && placedIn(cloud, scene);
    const usable = placed ? usableIndices(placed) : new Uint32Array(0);
    const isSmall = placed !== undefined && placed.count <= MAX_SPLATS;
    const packer = isSmall && scene.geometry === 'quantized' ? code : undefined;
    if (placed) packer?.load(placed, scene);
    splats += usable.length;
    const places = volumes.map((volume) => volume && relative(volume, scene.origin));
    const isLeaf = isAdded || volumes.length === 0;
    const [rest, ...parts] = given
      ? cut(usable, given)
      : isLeaf
        ? [usable, ...volumes.map(() => new Uint32Array(0))]
        : [new Uint32Array(0), ...divided(placed, usable, places, packer)];
    parts.forEach((own, child) => {
      counts.push(own.length);
      const run = packPart(placed, own, scene, boxOf(places[child], above), packer);
      const sphere = sphereAround(run.chunks, places[child]);
      const spacing = own.length > 1 ? spacingIn(placed!, own, packer) : 0;
      const estimate =
        own.length === 0 ? 2 * sphere[3] : CELL_ERROR * (spacing || (2 * sphere[3]) / Math.sqrt(own.length));
      replaced.push({ ...run, ...within(sphere, own.length === 0 ? estimate : Math.min(error, estimate), above) });
    });
    if (rest.length === 0 && volumes.length > 0) continue;
    const run = packPart(placed, rest, scene, boxOf(undefined, above), packer);
    drawn.push({ ...run, sphere: sphereAround(run.chunks), error: 0 });
  }
  return {
    words: joinSlots([...replaced, ...drawn], scene),
    runs: replaced.map(({ chunks }) => chunks.length / CHUNK_NUMBERS),
    errors: replaced.map(({ sphere, error }) => [...sphere, error]),
    counts,
    splats,
  };
}

type Box = { readonly min: readonly number[]; readonly max: readonly number[] };

const spacingIn = ({ positions }: GaussianCloud, own: Uint32Array, packer?: NodePacker): number =>
  packer ? spacingBetween(packer.spacings(own)) : spacingOf(positions, own);

function packPart(
  cloud: GaussianCloud | undefined,
  own: Uint32Array,
  scene: StreamedScene,
  box: Box,
  packer?: NodePacker,
): ReturnType<typeof packRun> {
  if (packer && cloud && own.length > 0) {
    packer.order(cloud, own);
    return packer.pack(own, cloud.shDegree, scene);
  }
  if (cloud) own.set(mortonOrder(cloud.positions, own));
  return packRun(cloud ?? emptyCloud(scene), own, scene, box);
}

const emptyCloud = ({ shDegree, antialiased, filterVariance, origin }: StreamedScene): GaussianCloud => {
  const none = new Float32Array(0);
  return {
    ...{ count: 0, droppedCount: 0, positions: none, scales: none, rotations: none, opacities: none, sh: none },
    ...{ shDegree, antialiased, filterVariance, origin },
  };
};

/** Returns a volume relative to the origin of the scene. */
const relative = (volume: readonly number[], origin: readonly number[]): readonly number[] =>
  volume.map((x, k) => (k < 3 ? x - origin[k] : x));

/** Returns the box around a volume, or around the sphere of a run, for a part without splats. */
function boxOf(volume: readonly number[] | undefined, above: RunError | undefined): Box {
  const [center, half] = volume
    ? [
        volume,
        [0, 1, 2].map((axis) => Math.abs(volume[3 + axis]) + Math.abs(volume[6 + axis]) + Math.abs(volume[9 + axis])),
      ]
    : [above ?? [0, 0, 0], [0, 1, 2].map(() => above?.[3] ?? 0)];
  return { min: half.map((x, axis) => center[axis] - x), max: half.map((x, axis) => center[axis] + x) };
}

/** Returns the splats after those of all parts, then those of each part. @param usable Indices of the splats, ascending. */
function cut(usable: Uint32Array, parts: readonly number[]): Uint32Array<ArrayBuffer>[] {
  let [first, at] = [0, 0];
  const own = parts.map((count) => {
    first += count;
    const from = at;
    while (at < usable.length && usable[at] < first) at++;
    return usable.slice(from, at);
  });
  return [usable.slice(at), ...own];
}

/** Divides splats among volumes: each belongs to the nearest one, or to the first of those that contain it. */
function divided(
  cloud: GaussianCloud | undefined,
  usable: Uint32Array,
  volumes: readonly (readonly number[] | undefined)[],
  packer: NodePacker | undefined,
): Uint32Array<ArrayBuffer>[] {
  const known = Uint32Array.from(volumes.flatMap((volume, k) => (volume ? k : [])));
  const boxes = new Float64Array(BOX_NUMBERS * known.length);
  known.forEach((k, box) => {
    const volume = volumes[k]!;
    const axes = [3, 6, 9].map((at) => volume.slice(at, at + 3));
    const lengths = axes.map((axis) => Math.hypot(...axis));
    // An axis of length 0 has no direction, and divides nothing.
    const units = axes.flatMap((axis, n) => axis.map((x) => (lengths[n] > 0 ? x / lengths[n] : 0)));
    boxes.set([...volume.slice(0, 3), ...units, ...lengths], BOX_NUMBERS * box);
  });
  const counts = new Uint32Array(volumes.length);
  const owners =
    cloud && packer ? packer.divide(usable, boxes, known, counts) : ownersOf(cloud, usable, boxes, known, counts);
  const parts = Array.from(counts, (count) => new Uint32Array(count));
  counts.fill(0);
  for (let n = 0; n < usable.length; n++) parts[owners[n]][counts[owners[n]]++] = usable[n];
  return parts;
}

/** See `NodePacker.divide`. */
function ownersOf(
  cloud: GaussianCloud | undefined,
  usable: Uint32Array,
  boxes: Float64Array,
  ids: Uint32Array,
  counts: Uint32Array,
): Uint32Array {
  const positions = cloud?.positions ?? new Float32Array(0);
  const owners = new Uint32Array(usable.length);
  for (let n = 0; n < usable.length; n++) {
    let [owner, nearest] = [0, Infinity];
    for (let box = 0; box < ids.length; box++) {
      const distance = outsideOf(boxes, BOX_NUMBERS * box, positions, 3 * usable[n]);
      if (distance < nearest) [owner, nearest] = [ids[box], distance];
    }
    counts[owner]++;
    owners[n] = owner;
  }
  return owners;
}

/** Returns the distance of a position from a box; inside of the box the negative distance from its nearest side. */
function outsideOf(boxes: Float64Array, box: number, positions: Float32Array, at: number): number {
  const dx = positions[at] - boxes[box];
  const dy = positions[at + 1] - boxes[box + 1];
  const dz = positions[at + 2] - boxes[box + 2];
  let [outside, inside] = [0, -Infinity];
  for (let axis = 0, unit = box + 3; axis < 3; axis++, unit += 3) {
    const along = dx * boxes[unit] + dy * boxes[unit + 1] + dz * boxes[unit + 2];
    const beyond = Math.abs(along) - boxes[box + 12 + axis];
    if (beyond > 0) outside += beyond * beyond;
    if (beyond > inside) inside = beyond;
  }
  return outside > 0 ? Math.sqrt(outside) : inside;
}

/** Returns center and radius of a sphere around a volume and around the boxes of chunks. */
function sphereAround(chunks: Float32Array, volume?: readonly number[]): number[] {
  const corners = (at: number): readonly [low: number, high: number][] =>
    [0, 1, 2].map((axis) => [chunks[at + axis], chunks[at + 4 + axis]]);
  const sides = [0, 1, 2].map((): [number, number] => [Infinity, -Infinity]);
  for (let at = 0; at < chunks.length; at += CHUNK_NUMBERS) {
    corners(at).forEach(([low, high], axis) => {
      sides[axis] = [Math.min(sides[axis][0], low), Math.max(sides[axis][1], high)];
    });
  }
  const center = volume ? volume.slice(0, 3) : sides.map(([low, high]) => (low + high) / 2);
  const reach = Math.hypot(...sides.map(([low, high], axis) => Math.max(high - center[axis], center[axis] - low)));
  return [...center, Math.max(reach, volume?.[12] ?? 0)];
}

/** Returns a sphere and an error that are within those of the run above: see {@link packNodes}. */
function within(sphere: readonly number[], error: number, above?: RunError): Pick<PackedRun, 'sphere' | 'error'> {
  const own = sphere.map(Math.fround);
  if (!above) return { sphere: own, error: Math.fround(error) };
  const apart = Math.hypot(...[0, 1, 2].map((axis) => own[axis] - above[axis]));
  const radius = Math.min(own[3], (above[3] - apart) / STRICTLY);
  return {
    sphere: radius >= MIN_SHRINK * own[3] ? [own[0], own[1], own[2], Math.fround(radius)] : above.slice(0, 4),
    error: Math.fround(Math.min(error, above[4] / STRICTLY)),
  };
}
