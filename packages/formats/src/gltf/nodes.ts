import { matrixOfQuaternion } from '@gaussian-splat/core';
import type { Json } from './container.js';
import type { GltfDocument } from './document.js';
import { isObject } from '../json.js';

/** Affine transform, a row-major 3x4 matrix: [a, b, c, tx, d, e, f, ty, g, h, i, tz]. */
export type Affine = readonly number[];

/** An instance of a mesh: its index, and the transform from its coordinates to those of the scene. */
export interface PlacedMesh {
  readonly mesh: number;
  readonly toScene: Affine;
}

const IDENTITY: Affine = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/** Maximum number of visited nodes. A scene may contain the same mesh many times. */
const MAX_PLACES = 10_000;
const MAX_DEPTH = 1_000;

/**
 * Returns the meshes of the default scene, or of all nodes if the file has no scenes. Throws as {@link walkNodes} does.
 */
export function placedMeshes(document: GltfDocument): PlacedMesh[] {
  const placed: PlacedMesh[] = [];
  walkNodes(document, (json, toScene) => {
    if (document.isIndex(json.mesh)) placed.push({ mesh: json.mesh, toScene });
  });
  return placed;
}

/**
 * Visits each node of the default scene, or each node if the file has no scenes. A node with several parents is visited
 * several times. Throws `decode/header` for more than 10,000 visits, or a depth above 1,000.
 * @param visit Called with the node, the transform from its coordinates to those of the scene, and its index.
 */
export function walkNodes(document: GltfDocument, visit: (node: Json, toScene: Affine, index: number) => void): void {
  // Stack of lists of children. Lists are not copied, because many nodes may have the same long list.
  const open = [{ nodes: rootNodes(document), next: 0, parent: IDENTITY }];
  for (let visited = 0; open.length > 0;) {
    const list = open[open.length - 1];
    if (list.next === list.nodes.length) {
      open.pop();
      continue;
    }
    if (visited++ > MAX_PLACES) document.fail('nodes', `at most ${MAX_PLACES} nodes`, 'more');
    if (open.length > MAX_DEPTH) document.fail('nodes', 'a tree', 'nodes that contain themselves');
    const index = list.nodes[list.next++];
    const json = document.item('nodes', index);
    const toScene = multiply(list.parent, localTransform(json, document));
    visit(json, toScene, index as number);
    if (Array.isArray(json.children)) open.push({ nodes: json.children, next: 0, parent: toScene });
  }
}

/** Returns the indices of the root nodes of the default scene; of all nodes without a parent if the file has no scenes. */
export function rootNodes(document: GltfDocument): unknown[] {
  const { scenes, scene = 0, nodes } = document.json;
  if (Array.isArray(scenes) && scenes.length > 0) {
    const { nodes: roots } = document.item('scenes', scene);
    return Array.isArray(roots) ? roots : [];
  }
  if (!Array.isArray(nodes)) return [];
  const children = new Set(
    nodes.flatMap((node) => (isObject(node) && Array.isArray(node.children) ? node.children : [])),
  );
  return nodes.map((_, index) => index).filter((index) => !children.has(index));
}

function localTransform(node: Json, document: GltfDocument): Affine {
  const numbers = (key: string, fallback: readonly number[]): readonly number[] => {
    const value = node[key] ?? fallback;
    const isFine = Array.isArray(value) && value.length === fallback.length && value.every((n) => Number.isFinite(n));
    return isFine ? (value as number[]) : document.fail(`nodes, ${key}`, `${fallback.length} numbers`, value);
  };
  if (node.matrix !== undefined) {
    const m = numbers('matrix', new Array(16).fill(0));
    return [m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14]];
  }
  const [x, y, z, w] = numbers('rotation', [0, 0, 0, 1]);
  const move = numbers('translation', [0, 0, 0]);
  const scale = numbers('scale', [1, 1, 1]);
  const turn = matrixOfQuaternion(w, x, y, z);
  return move.flatMap((offset, row) => [...scale.map((size, column) => turn[3 * row + column] * size), offset]);
}

/** Returns the product a · b, which applies `b` first. */
export function multiply(a: Affine, b: Affine): Affine {
  const product: number[] = [];
  for (let row = 0; row < 12; row += 4) {
    for (let column = 0; column < 4; column++) {
      const sum = a[row] * b[column] + a[row + 1] * b[4 + column] + a[row + 2] * b[8 + column];
      product.push(column === 3 ? sum + a[row + 3] : sum);
    }
  }
  return product;
}
