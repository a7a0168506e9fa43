/** Reads scenes whose files are trees of levels, node by node. The worker loads this module for the first such scene. */
import { boundsOf, type Bounds, type Credits, type GaussianCloud } from '@gaussian-splat/core';
import { innerViewOf } from '@gaussian-splat/core/views';
import { SharedReads } from '@gaussian-splat/core/fetch';
import {
  fetchRange,
  fetchScene,
  joinCredits,
  LoadBudget,
  mergeClouds,
  openTree as openFormat,
  partAddress,
  readNode as readFormat,
  sogAddress,
  SogFiles,
  type FetchSceneOptions,
  type LoadLimits,
  type ReadNode,
  type SceneNode,
  type SceneTree,
  type TreeFiles,
} from '@gaussian-splat/formats';
import type { StreamedScene } from '@gaussian-splat/renderer';
import {
  choosePrecision,
  NodePacker,
  noiseIn,
  packNodes,
  pageLayout,
  recentered,
  usableIndices,
  type FetchedNode,
  type NodeContent,
  type NodePage,
  type OpenedTree,
  type RunError,
} from '@gaussian-splat/renderer/tools';
import { fileLimits, fileName, limitsFrom, named, throttled } from './load-scene.js';
import { ProgressSum } from './progress-sum.js';
import type { SceneLimits, SceneRequest, TaskListeners } from './protocol.js';

/** A tree whose coarsest nodes have been read. */
export interface LoadedTree extends OpenedTree<SceneNode> {
  /** Parameters for reading nodes. */
  readonly tree: Pick<SceneTree, 'container' | 'facts'>;
  readonly warnings: readonly string[];
  /** Credits of the coarsest nodes. */
  readonly credits: Credits | undefined;
}

/**
 * A request for a node. It contains all data that the worker needs, because the worker may have been restarted since the
 * previous request.
 */
export interface NodeRequest {
  /** Absolute address of the scene's file. */
  readonly url: string;
  readonly credentials: RequestCredentials;
  readonly tree: Pick<SceneTree, 'container' | 'facts'>;
  /** The node. Its children have no children and no places of splats. */
  readonly node: SceneNode;
  readonly scene: StreamedScene;
  /** The run that the page of the node replaces. */
  readonly above: RunError;
  readonly limits?: SceneLimits | undefined;
}

/** A page of a node, and warnings about content that is not drawn. */
export interface LoadedNode extends FetchedNode<SceneNode> {
  readonly warnings: readonly string[];
}

/** Maximum number of nodes in the first page, if nodes without splats are replaced by their children. */
const MAX_FIRST = 16;
/** Maximum number of splats of these nodes. */
const MAX_FIRST_SPLATS = 500_000;
/** Bytes at the beginning of a RAD file, which describe 700 chunks or 46 million splats. */
const HEAD_BYTES = 65_536;
/** Number of nodes that are read at the same time. */
const AT_A_TIME = 8;

type Read = readonly [node: SceneNode, read: ReadNode];

/**
 * Opens a scene whose file is a tree, and reads its coarsest nodes. Resolves to undefined for a file without levels. Throws GaussianSplatError (`network/*`, `decode/*`,
 * `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function openTree(
  request: SceneRequest,
  signal: AbortSignal,
  { onProgress }: Pick<TaskListeners, 'onProgress'>,
): Promise<LoadedTree | undefined> {
  const { url, credentials, sh, isExact } = request;
  const name = fileName(url);
  const limits = limitsFrom({ limits: { ...request.limits, maxSplats: undefined } });
  const progress = new ProgressSum(throttled(onProgress), true);
  const options = (): FetchSceneOptions => ({
    ...{ mode: 'cors', credentials, signal, onProgress: progress.add() },
    ...fileLimits(limits()),
  });
  try {
    // Only the description at the beginning of a RAD file is needed.
    const bytes = /\.rad$/i.test(name)
      ? (await fetchRange(url, 0, HEAD_BYTES, options())).bytes
      : await fetchScene(url, options());
    const budget = new LoadBudget(bytes.length, limits());
    const files = filesBeside({ url, name, budget, sogs: budget, signal, options });
    const tree = await openFormat(bytes, files);
    if (!tree) return undefined;
    const nodes = await readFirst(tree, files);
    const clouds = nodes.flatMap(([, { cloud }]) => cloud ?? []);
    const scene = sceneOf(clouds, tree, { sh, isExact, name, budget });
    const first = await packed(nodes, scene, files);
    const children = nodes.flatMap(childrenOf);
    const { container, facts, isComplete, splats } = tree;
    const warnings = clouds.flatMap((cloud) => cloud.warnings ?? []);
    const credits = joinCredits(clouds.map(({ hints }) => hints?.credits));
    return { scene, first, children, isComplete, splats, tree: { container, facts }, warnings, credits };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

/** Reads a node, and packs its page. Throws as {@link openTree} does. */
export async function readNode(
  { url, credentials, tree, node, scene, above, limits }: NodeRequest,
  signal: AbortSignal,
): Promise<LoadedNode> {
  const name = fileName(url);
  try {
    const all: LoadLimits = { ...limits, maxSplats: undefined };
    const options = (): FetchSceneOptions => ({ mode: 'cors', credentials, signal, ...fileLimits(all) });
    const files = filesBeside({ url, name, budget: new LoadBudget(0, all), signal, options });
    const read = await readFormat(tree, node, files);
    signal.throwIfAborted();
    const page = await packed([[node, read]], scene, files, above);
    return { ...page, found: read.found, warnings: read.cloud?.warnings ?? [] };
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

/** Reads the coarsest nodes. Nodes without splats are replaced by their children, as long as these are few. */
async function readFirst({ container, facts, roots, isDescended }: SceneTree, files: TreeFiles): Promise<Read[]> {
  const readAll = async (nodes: readonly SceneNode[]): Promise<Read[]> => {
    const all: Read[] = [];
    for (let k = 0; k < nodes.length; k += AT_A_TIME) {
      const some = nodes.slice(k, k + AT_A_TIME);
      const reads = await Promise.all(some.map((node) => readFormat({ container, facts }, node, files)));
      some.forEach((node, n) => all.push([node, reads[n]]));
    }
    return all;
  };
  let reads = await readAll(roots);
  while (isDescended) {
    const below = reads.map((read) => (read[1].cloud ? [] : childrenOf(read)));
    const count = below.reduce((sum, { length }) => sum + Math.max(1, length), 0);
    if (count > MAX_FIRST || below.every(({ length }) => length === 0)) break;
    const next: Read[] = [];
    for (const [k, nodes] of below.entries()) next.push(...(nodes.length > 0 ? await readAll(nodes) : [reads[k]]));
    if (next.reduce((sum, [, { cloud }]) => sum + (cloud?.count ?? 0), 0) > MAX_FIRST_SPLATS) break;
    reads = next;
  }
  return reads;
}

const childrenOf = ([node, { found }]: Read): SceneNode[] => [...node.children, ...found];

const contentOf = ([node, { cloud, found, parts, isAdded, error }]: Read): NodeContent => ({
  ...{ cloud, parts, isAdded, error },
  volumes: [...node.children, ...found].map(({ volume }) => volume),
});

/** Packs nodes as a page. Throws `out-of-memory/budget` for more children than the arrived bytes allow. */
async function packed(
  nodes: readonly Read[],
  scene: StreamedScene,
  { budget, name }: TreeFiles,
  above?: RunError,
): Promise<NodePage> {
  const children = nodes.reduce((sum, read) => sum + childrenOf(read).length, 0);
  // Each child has a chunk, even if no splats of the node are in its volume.
  budget.take(4 * pageLayout(scene, 1).total * children, name);
  return packNodes(nodes.map(contentOf), scene, above, await NodePacker.open());
}

/** Returns the properties of a scene, which follow from its coarsest splats. */
function sceneOf(
  clouds: readonly GaussianCloud[],
  { roots: [root], up }: SceneTree,
  { sh, isExact, ...account }: Pick<SceneRequest, 'sh' | 'isExact'> & Pick<TreeFiles, 'budget' | 'name'>,
): StreamedScene {
  const merged = mergeClouds(
    clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
    account,
  );
  const whole = recentered(merged);
  const usable = usableIndices(whole);
  const { shDegree, antialiased, filterVariance, hints } = whole;
  const [x, y, z] = root.volume ?? whole.origin;
  const center = [x, y, z] as const;
  const isEmpty = usable.length === 0;
  const bounds: Bounds = isEmpty
    ? { min: center, max: center, center, radius: root.volume?.[12] ?? 1 }
    : boundsOf(whole);
  return {
    ...{ shDegree, antialiased, filterVariance, order: hints?.order, splats: whole.count },
    geometry: isExact ? undefined : 'quantized',
    shPrecision: sh === 'auto' ? choosePrecision(noiseIn(whole, usable), usable.length) : sh,
    origin: isEmpty ? center : whole.origin,
    // The page takes the vertical axis from the bounds, as for files.
    bounds: { ...bounds, inside: isEmpty ? undefined : innerViewOf(whole, bounds), ...hints, ...(up && { up }) },
  };
}

interface Beside extends Pick<TreeFiles, 'name' | 'budget' | 'signal'> {
  readonly url: string;
  readonly options: () => FetchSceneOptions;
  /** Account of SOG files. Without it each file has its own, so that nodes of all requests share its reading. */
  readonly sogs?: LoadBudget;
}

/** Files of servers that do not support range requests, by address. Only the latest file is kept. */
const wholeFiles = new Map<string, Promise<Uint8Array>>();

/** Maximum bytes that are kept because they describe several nodes, of all scenes. */
const INDEX_BYTES = 8e6;
const indices = new SharedReads<Uint8Array>(({ byteLength }) => byteLength, INDEX_BYTES);

/** Maximum bytes of decoded splats that are kept because several nodes share their file, of all scenes. */
const SOG_BYTES = 32e6;
const sogFiles = new SogFiles(SOG_BYTES);

/** Returns access to the files beside a scene. */
function filesBeside({ url, name, budget, signal, options, sogs }: Beside): TreeFiles {
  const counted = async (read: () => Promise<Uint8Array>): Promise<Uint8Array> => {
    budget.request(name);
    const bytes = await read();
    budget.arrive(bytes.length);
    return bytes;
  };
  const fetchPart = async (address: string, start: number, end: number, ended = signal): Promise<Uint8Array> => {
    const kept = await wholeFiles.get(address);
    if (kept) return kept.subarray(start, end);
    const { bytes, isPartial } = await fetchRange(address, start, end, { ...options(), signal: ended });
    if (isPartial || start === 0) return bytes;
    const whole = wholeFiles.get(address) ?? fetchScene(address, { ...options(), signal: ended });
    wholeFiles.clear();
    wholeFiles.set(address, whole);
    whole.catch(() => wholeFiles.delete(address));
    return (await whole).subarray(start, end);
  };
  return {
    ...{ name, budget, signal },
    openFile: (path, query) => counted(() => fetchScene(partAddress(url, path, query).href, options())),
    openIndex: (path, query) => {
      const { href } = partAddress(url, path, query);
      const read = (ended: AbortSignal): Promise<Uint8Array> => fetchScene(href, { ...options(), signal: ended });
      return counted(() => indices.read(href, read, signal));
    },
    openShared: (path, start, end) => {
      const address = path === undefined ? url : partAddress(url, path).href;
      const read = (ended: AbortSignal): Promise<Uint8Array> => fetchPart(address, start, end, ended);
      return counted(() => indices.read(`${address} ${start}-${end}`, read, signal));
    },
    openSog: (path) => {
      const fetch = (part: string, ended: AbortSignal): Promise<Uint8Array> =>
        fetchScene(part, { ...options(), signal: ended });
      return sogFiles.open(sogAddress(path, name, url), fetch, signal, sogs);
    },
    openRange: (path, start, end) => counted(() => fetchPart(partAddress(url, path).href, start, end)),
  };
}
