/**
 * Reader of the solid voxels that splat-transform writes (`.voxel.json` and `.voxel.bin`, versions 1.0 and 1.1), for
 * finding a floor.
 */
import type { Vector3 } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject, parseJson, show } from '../json.js';
import { MAX_VOXELS, type UpFrame, type VoxelGrid } from './extinction.js';

/** Number of voxels along the edge of a block, which is a leaf of the octree. */
const BLOCK = 4;
const SOLID = 0xff000000;
const MAX_HEAD_BYTES = 1 << 20;
/** Maximum number of voxels of the upright grid, which is larger than the rotated grid that it encloses. */
const MAX_UPRIGHT = 4 * MAX_VOXELS;
/** Maximum number of nodes, because links have 24 bits. */
const MAX_ENTRIES = 1 << 24;
const SUFFIX = /\.voxel\.json$/i;

export interface VoxelFiles {
  /** Bytes of the `.voxel.json`. */
  readonly head: Uint8Array;
  /** Bytes of the `.voxel.bin`. */
  readonly tree: Uint8Array;
  readonly name: string;
  readonly limits?: LoadLimits | undefined;
}

/** Voxels, [nz, ny, nx], 1 for solid, 0 for empty, on a grid with y up and lengths in meters. */
export interface SolidGrid {
  readonly grid: VoxelGrid;
  readonly solid: Uint8Array;
}

/** Whether a path ends with `.voxel.json`. */
export const isVoxelPath = (path: string): boolean => SUFFIX.test(path);

/** Returns the path of the octree, `.voxel.bin`, for the path of a `.voxel.json`. */
export const voxelTreePath = (path: string): string => path.replace(SUFFIX, '.voxel.bin');

/**
 * Reads solid voxels, and rotates them so that y is up.
 * @param frame Rows of the rotation from the coordinates of the splats' file to those with y up.
 * @param metersPerUnit Meters in a unit of the splats' file.
 * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`
 */
export function readVoxels(files: VoxelFiles, frame: UpFrame, metersPerUnit: number): SolidGrid {
  const { name, tree } = files;
  const budget = new LoadBudget(files.head.length + tree.length, files.limits);
  const head = readHead(files, budget);
  const { nodes: nodeCount, words, blocks } = head;
  if (tree.length !== 4 * (nodeCount + words))
    throw damaged(name, `${grouped(4 * (nodeCount + words))} bytes of nodes and masks`, grouped(tree.length));
  budget.take(tree.length, name);
  const view = new DataView(tree.buffer, tree.byteOffset, tree.byteLength);
  const numbers = Uint32Array.from({ length: nodeCount + words }, (_, i) => view.getUint32(4 * i, true));
  const octree = { nodes: numbers.subarray(0, nodeCount), masks: numbers.subarray(nodeCount) };
  const size = blocks.map((count) => BLOCK * count) as unknown as VoxelGrid['size'];
  budget.take(size[0] * size[1] * size[2], name);
  const solid = new Octree(octree, head.depth, size, name).solids();
  const grid = { corner: head.corner, size, voxel: head.voxel };
  return upright({ grid, solid }, turnedRows(frame, head.isTurned), metersPerUnit, { name, budget });
}

interface VoxelHead {
  readonly corner: Vector3;
  readonly blocks: readonly number[];
  readonly voxel: number;
  readonly depth: number;
  readonly nodes: number;
  readonly words: number;
  /** Whether coordinates are those of the splats' file rotated by half a turn about z, as from version 1.1 on. */
  readonly isTurned: boolean;
}

function readHead({ head, name }: VoxelFiles, budget: LoadBudget): VoxelHead {
  const { version, gridBounds, voxelResolution, leafSize, treeDepth, nodeCount, leafDataCount } = parseJson(
    { bytes: head, name, budget },
    MAX_HEAD_BYTES,
  );
  const found = /^(\d+)\.(\d+)$/.exec(typeof version === 'object' ? '' : String(version));
  if (found?.[1] !== '1') throw damaged(name, 'version 1.0 or 1.1', show(version), 'decode/unsupported');
  const number = (path: string, value: unknown, lowest: number, highest: number): number => {
    if (typeof value === 'number' && value >= lowest && value <= highest) return value;
    throw damaged(`${name}, ${path}`, `a number from ${lowest} to ${highest}`, show(value), 'decode/header');
  };
  const whole = (path: string, value: unknown, lowest: number, highest: number): number => {
    if (Number.isInteger(value)) return number(path, value, lowest, highest);
    throw damaged(`${name}, ${path}`, 'a whole number', show(value), 'decode/header');
  };
  if (!isObject(gridBounds)) throw damaged(`${name}, gridBounds`, 'min and max', show(gridBounds), 'decode/header');
  const corner = (path: 'min' | 'max'): Vector3 => {
    const at: unknown = gridBounds[path];
    if (!Array.isArray(at) || at.length !== 3)
      throw damaged(`${name}, gridBounds.${path}`, 'three numbers', show(at), 'decode/header');
    return at.map((value) => number(`gridBounds.${path}`, value, -1e9, 1e9)) as unknown as Vector3;
  };
  whole('leafSize', leafSize, BLOCK, BLOCK);
  const voxel = number('voxelResolution', voxelResolution, 1e-6, 1e6);
  const depth = whole('treeDepth', treeDepth, 1, 24);
  const [min, max] = [corner('min'), corner('max')];
  const blocks = min.map((low, k) => Math.round((max[k] - low) / (BLOCK * voxel)));
  const isWithin = blocks.every((count) => count >= 1 && count <= 2 ** depth);
  const voxels = blocks.reduce((product, count) => product * BLOCK * count, 1);
  if (!isWithin) throw damaged(`${name}, gridBounds`, `1 to ${2 ** depth} blocks along each axis`, blocks.join(' x '));
  if (voxels > MAX_VOXELS)
    throw damaged(name, `at most ${grouped(MAX_VOXELS)} voxels`, grouped(voxels), 'decode/unsupported');
  return {
    ...{ corner: min, blocks, voxel, depth, isTurned: found[2] !== '0' },
    nodes: whole('nodeCount', nodeCount, 0, MAX_ENTRIES),
    words: whole('leafDataCount', leafDataCount, 0, 2 * MAX_ENTRIES),
  };
}

/** Decoder of an octree. Children are stored after their parents, so that there are no cycles. */
class Octree {
  readonly #nodes: Uint32Array;
  readonly #masks: Uint32Array;
  readonly #depth: number;
  readonly #size: VoxelGrid['size'];
  readonly #name: string;
  readonly #solid: Uint8Array;

  constructor(
    { nodes, masks }: { readonly nodes: Uint32Array; readonly masks: Uint32Array },
    depth: number,
    size: VoxelGrid['size'],
    name: string,
  ) {
    this.#nodes = nodes;
    this.#masks = masks;
    this.#depth = depth;
    this.#size = size;
    this.#name = name;
    this.#solid = new Uint8Array(size[0] * size[1] * size[2]);
  }

  solids(): Uint8Array {
    if (this.#nodes.length > 0) this.#visit(0, this.#depth, 0, 0, 0);
    return this.#solid;
  }

  /**
   * Marks the solid voxels of a node and its children.
   * @param at Index of the node.
   * @param level Number of subdivisions from the node to blocks.
   * @param x Coordinate of the node's first voxel, in voxels, as `y` and `z`.
   */
  #visit(at: number, level: number, x: number, y: number, z: number): void {
    const [nx, ny, nz] = this.#size;
    // Nodes outside the grid are skipped, so that each visit covers other voxels of the grid.
    if (x >= nx || y >= ny || z >= nz) return;
    const word = this.#nodes[at];
    const edge = BLOCK * 2 ** level;
    if (word === SOLID) return this.#fill(edge, x, y, z, () => true);
    const mask = word >>> 24;
    if (mask === 0) {
      if (level > 0 || 2 * word + 1 >= this.#masks.length) throw this.#fault(at);
      const [low, high] = [this.#masks[2 * word], this.#masks[2 * word + 1]];
      return this.#fill(edge, x, y, z, (bit) => (((bit < 32 ? low : high) >>> (bit % 32)) & 1) === 1);
    }
    let child = word & 0xffffff;
    if (level === 0 || child <= at) throw this.#fault(at);
    for (let octant = 0; octant < 8; octant++) {
      if (((mask >>> octant) & 1) === 0) continue;
      if (child >= this.#nodes.length) throw this.#fault(at);
      const half = edge / 2;
      const upper = (axis: number): number => half * ((octant >>> axis) & 1);
      this.#visit(child++, level - 1, x + upper(0), y + upper(1), z + upper(2));
    }
  }

  #fill(edge: number, x: number, y: number, z: number, isSolid: (bit: number) => boolean): void {
    const [nx, ny, nz] = this.#size;
    for (let k = z; k < Math.min(nz, z + edge); k++)
      for (let j = y; j < Math.min(ny, y + edge); j++)
        for (let i = x; i < Math.min(nx, x + edge); i++)
          if (isSolid((i & 3) + 4 * (j & 3) + 16 * (k & 3))) this.#solid[i + nx * (j + ny * k)] = 1;
  }

  #fault(at: number): Error {
    return damaged(
      this.#name,
      'an octree whose nodes lead to nodes and masks behind them',
      `node ${at}: ${show(`0x${this.#nodes[at].toString(16)}`)}`,
    );
  }
}

/** Returns the rows of a rotation from the coordinates of voxels to those with y up. */
function turnedRows(frame: UpFrame, isTurned: boolean): readonly (readonly number[])[] {
  const sign = isTurned ? [-1, -1, 1] : [1, 1, 1];
  return frame.map((row) => row.map((value, k) => value * sign[k]));
}

/** Resamples voxels on a rotated grid with y up. Each new voxel has the value of the old voxel at its center. */
function upright(
  { grid, solid }: SolidGrid,
  rows: readonly (readonly number[])[],
  unit: number,
  { name, budget }: { readonly name: string; readonly budget: LoadBudget },
): SolidGrid {
  const { size: old, voxel } = grid;
  const ends = grid.corner.map((low, k) => [low, low + old[k] * voxel]);
  const ranges = rows.map((row) =>
    [Math.min, Math.max].map((pick) => sum(row.map((v, k) => pick(...ends[k].map((end) => v * end))))),
  );
  const size = ranges.map(([low, high]) => Math.max(1, Math.round((high - low) / voxel))) as unknown as Vector3;
  const corner = ranges.map(([low]) => low) as unknown as Vector3;
  const voxels = size[0] * size[1] * size[2];
  if (voxels > MAX_UPRIGHT)
    throw damaged(name, `at most ${grouped(MAX_UPRIGHT)} voxels with y up`, grouped(voxels), 'decode/unsupported');
  budget.take(voxels, name);
  const turned = new Uint8Array(voxels);
  // The transpose of `rows` is its inverse. Along x, the old coordinate of each axis grows by a constant.
  const axes = [0, 1, 2];
  const steps = axes.map((axis) => rows[0][axis]);
  for (let z = 0, at = 0; z < size[2]; z++)
    for (let y = 0; y < size[1]; y++) {
      budget.take(size[0], name);
      const center = [corner[0], corner[1] + (y + 0.5) * voxel, corner[2] + (z + 0.5) * voxel];
      const starts = axes.map((axis) => (sum(rows.map((row, k) => row[axis] * center[k])) - grid.corner[axis]) / voxel);
      for (let x = 0; x < size[0]; x++, at++) {
        const i = Math.floor(starts[0] + (x + 0.5) * steps[0]);
        const j = Math.floor(starts[1] + (x + 0.5) * steps[1]);
        const k = Math.floor(starts[2] + (x + 0.5) * steps[2]);
        const isInside = i >= 0 && j >= 0 && k >= 0 && i < old[0] && j < old[1] && k < old[2];
        if (isInside) turned[at] = solid[i + old[0] * (j + old[1] * k)];
      }
    }
  const scaled = corner.map((value) => unit * value) as unknown as Vector3;
  return { grid: { corner: scaled, size, voxel: unit * voxel }, solid: turned };
}

const sum = (values: readonly number[]): number => values.reduce((total, value) => total + value, 0);
