import { loadModule } from '@gaussian-splat/core';
import { isJsonWith, isRad } from '../signatures.js';
import type { ReadNode, SceneNode, SceneTree, TreeContainer, TreeFiles, TreeReader } from './types.js';

const READERS: Readonly<Record<TreeContainer, () => Promise<{ readonly reader: TreeReader }>>> = {
  tiles: () => import('./tiles.js'),
  lcc: () => import('./lcc.js'),
  lcc2: () => import('./lcc2.js'),
  rad: () => import('./rad.js'),
};

const isLcc = isJsonWith(/"totalLevel"\s*:/);
const isLcc2 = isJsonWith(/"(totalLevels|lod_3dgs_info)"\s*:/);

const readerOf = async (container: TreeContainer): Promise<TreeReader> =>
  (await loadModule('the code that reads levels', READERS[container])).reader;

/**
 * Opens a scene whose file is a tree of levels: a tileset of 3D Tiles, LCC, LCC2, or RAD. Its nodes can then be read separately.
 * @param bytes The file of the scene, which describes the tree or its beginning. The beginning of a RAD file is enough.
 * @returns Undefined for files without levels, and for LCC2 whose nodes have no boxes.
 * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`, or the errors of `files`.
 */
export async function openTree(bytes: Uint8Array, files: TreeFiles): Promise<SceneTree | undefined> {
  const container = isRad(bytes) ? 'rad' : isLcc(bytes) ? 'lcc' : isLcc2(bytes) ? 'lcc2' : 'tiles';
  return (await readerOf(container)).open(bytes, files);
}

/**
 * Reads a node, and the children that its files list.
 * @param node The node. Of its children, only the number matters.
 * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`, or the errors of `files`.
 */
export async function readNode(
  { container, facts }: Pick<SceneTree, 'container' | 'facts'>,
  node: SceneNode,
  files: TreeFiles,
): Promise<ReadNode> {
  return (await readerOf(container)).read(node, facts, files);
}
