import { GaussianSplatError } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';
import { pageLayout, SLOT_CHUNKS } from './manifest.js';
import type { NodePage, RunError } from './pack-nodes.js';
import { GrowingList } from './page-list.js';
import type { PageSource, StreamedScene } from './page-source.js';
import { slotBySlot } from './slot-words.js';

/** Maximum number of pages of a tree. Each takes about 50 bytes of CPU memory and 8 of GPU memory from the beginning. */
const MAX_PAGES = 1 << 17;
/** Minimum length of the arrays of pages. */
const PAGES_AHEAD = 1 << 15;
/** Assumed maximum number of slots of a page, 65,536 splats, which bounds the memory of a small tree. */
const PAGE_SLOTS = 64;
/** Minimum number of slots of a tree whose number of splats is known. */
const FIRST_SLOTS = 64;

/** A node whose known children can be counted. */
export interface TreeNode<Node> {
  readonly children: readonly Node[];
}

/** A scene whose file is a tree of levels, prepared for streaming. Plain data with a transferable buffer. */
export interface OpenedTree<Node> {
  readonly scene: StreamedScene;
  /** The page that is always resident. */
  readonly first: NodePage;
  /** The child of each run of {@link first}. */
  readonly children: readonly Node[];
  /** Whether {@link children} probably contain all nodes; otherwise reading a node finds more. */
  readonly isComplete: boolean;
  /** Number of splats of all nodes; undefined if unknown. */
  readonly splats?: number | undefined;
}

/** A page of a node, and the nodes that refine it. */
export interface FetchedNode<Node> extends NodePage {
  /** Children that the node did not list, whose runs follow those of the listed ones. */
  readonly found: readonly Node[];
}

/**
 * Returns the page source of a scene whose file is a tree of levels. The list of pages grows, because the splats and the
 * children of a node are unknown before its files are read.
 * @param fetchNode Fetches a node and packs it: see `packNodes`, preferably in a worker. `above` is the run that the
 * page of the node replaces.
 */
export function treeSource<Node extends TreeNode<Node>>(
  opened: OpenedTree<Node>,
  fetchNode: (node: Node, above: RunError, signal: AbortSignal) => Promise<FetchedNode<Node>>,
): PageSource {
  const chunkWords = pageLayout(opened.scene, 1).total;
  const known = 1 + countOf(opened.children);
  const capacity = Math.min(MAX_PAGES, Math.max(PAGES_AHEAD, 2 * known));
  const list = new GrowingList(capacity, slotsOf(opened, known));
  const nodes: Node[] = [];
  const above: RunError[] = [];
  /** Number of splats that each page replaces. */
  const replaced: number[] = [0];
  let splats = 0;
  const learn = (page: number, { words, runs, errors, counts, ...more }: NodePage, children: readonly Node[]): void => {
    const chunks = words.length / chunkWords;
    if (list.chunks[page] === chunks) return;
    if (list.chunks[page] > 0) throw changed(list.chunks[page], chunks);
    if (list.count + children.length > capacity) throw tooMany(capacity);
    list.measure(page, chunks);
    let first = 0;
    children.forEach((child, k) => {
      const own = list.append(page, first, runs[k]);
      [nodes[own], above[own], replaced[own]] = [child, errors[k], counts[k]];
      first += runs[k];
    });
    splats += more.splats - replaced[page];
  };
  learn(0, opened.first, opened.children);
  const scene = {
    ...opened.scene,
    get splats() {
      return splats;
    },
  };
  return {
    scene,
    list,
    fetch: async (page, signal) => {
      if (page === 0) return slotBySlot(opened.first.words, scene);
      const fetched = await fetchNode(nodes[page], above[page], signal);
      signal.throwIfAborted();
      learn(page, fetched, [...nodes[page].children, ...fetched.found]);
      return slotBySlot(fetched.words, scene);
    },
  };
}

/** Returns the maximum number of slots: twice those that all splats need, because runs leave gaps. */
function slotsOf({ isComplete, splats = Infinity }: OpenedTree<unknown>, known: number): number {
  const needed = FIRST_SLOTS + (2 * splats) / (SLOT_CHUNKS * constants.CULL_GROUP);
  return Math.ceil(Math.min(isComplete ? PAGE_SLOTS * known : Infinity, needed));
}

/** Returns the number of nodes in some trees. */
function countOf<Node extends TreeNode<Node>>(roots: readonly Node[]): number {
  let count = 0;
  const left = [...roots];
  for (let node = left.pop(); node; node = left.pop()) {
    count++;
    for (const child of node.children) left.push(child);
  }
  return count;
}

const changed = (expected: number, found: number): GaussianSplatError =>
  new GaussianSplatError('decode/corrupt', {
    where: 'node of a streamed scene',
    expected: `${expected} chunks, as before`,
    found: String(found),
    remedy: 'load the scene again, because its files have changed',
  });

const tooMany = (capacity: number): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where: 'streamed scene',
    expected: `at most ${capacity} nodes that have been visible`,
    found: 'more',
    remedy: 'write larger tiles; until then a coarser level is shown here',
  });
