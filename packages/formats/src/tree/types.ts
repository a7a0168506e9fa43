import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import type { LoadBudget } from '../budget.js';
import type { OpenFile } from '../scene-format.js';

/**
 * An oriented box and a sphere around it, in world units, [13]: center, three half axes, radius. The numbers are
 * float64, because georeferenced centers have seven digits before the point.
 */
export type Volume = readonly number[];

/**
 * A node of a scene whose file is a tree of levels. Plain data, which a message can contain. Each container adds the
 * places of the node's splats.
 */
export interface SceneNode {
  /** Volume that contains the node and all nodes below it; undefined if unknown. */
  readonly volume?: Volume | undefined;
  /** File that other nodes share, and whose reader keeps it decoded. */
  readonly file?: string | undefined;
  /** Known child nodes. Reading the node may find more. */
  readonly children: readonly SceneNode[];
}

/** Result of reading a node. */
export interface ReadNode {
  /** Splats of the node; absent if it has none. */
  readonly cloud?: GaussianCloud | undefined;
  /** Child nodes that were unknown, because another file lists them. */
  readonly found: readonly SceneNode[];
  /**
   * Number of splats that each child replaces, in the order of {@link cloud}; the remaining splats have no child. Absent
   * if the splats are divided by the volumes of the children.
   */
  readonly parts?: readonly number[];
  /** Whether the node is drawn in addition to its children, instead of being replaced by them. */
  readonly isAdded: boolean;
  /** Maximum error in world units of the node without its children, as the file declares it; Infinity if it does not. */
  readonly error: number;
}

/** Names of the containers whose nodes can be read separately. */
export type TreeContainer = 'tiles' | 'lcc' | 'lcc2' | 'rad';

/** A tree of levels whose root or roots are known. */
export interface SceneTree {
  readonly container: TreeContainer;
  /** Data that `readNode` needs, in addition to the node. */
  readonly facts: unknown;
  /** The coarsest nodes. */
  readonly roots: readonly SceneNode[];
  /** Whether the children of {@link roots} replace them at once if they have no splats. */
  readonly isDescended: boolean;
  /** Whether {@link roots} contain all nodes, judged by the addresses of contents. */
  readonly isComplete: boolean;
  /** Number of splats of all nodes, if the file states it. */
  readonly splats?: number;
  /** Vertical axis, if the container has one. */
  readonly up?: Vector3;
}

/** Access to the files of a scene. Paths are relative to the file of the scene. */
export interface TreeFiles {
  /** Name of the scene in error messages. */
  readonly name: string;
  /** Account of what is read. */
  readonly budget: LoadBudget;
  readonly signal?: AbortSignal | undefined;
  readonly openFile: OpenFile;
  /** Opens a file that describes several nodes, and keeps it for some time. */
  readonly openIndex: OpenFile;
  /** Opens bytes that describe several nodes, and keeps them. No path denotes the file of the scene. */
  readonly openShared: (path: string | undefined, start: number, end: number) => Promise<Uint8Array>;
  /** Opens a SOG file, and keeps it decoded for some time. Its cloud must not be modified. */
  readonly openSog: (path: string) => Promise<GaussianCloud>;
  /** Opens bytes `start` to `end`, excluding `end`, of a file. Resolves to fewer if the file ends before. */
  readonly openRange: (path: string, start: number, end: number) => Promise<Uint8Array>;
}

/** Code of a container of trees. */
export interface TreeReader {
  /** Resolves to undefined for a file without levels. */
  open(bytes: Uint8Array, files: TreeFiles): Promise<SceneTree | undefined>;
  read(node: SceneNode, facts: unknown, files: TreeFiles): Promise<ReadNode>;
}
