import type { Affine } from './gltf/nodes.js';
import type { ImplicitTile } from './implicit-tiles.js';
import type { SceneNode } from './tree/types.js';

/** A file of a tile. */
export interface TileContent {
  /** URI from the outermost tileset, with its query. */
  readonly uri: string;
  /** Transform from the coordinates of the tile (z up) to those of the outermost tileset. */
  readonly toTileset: Affine;
  /** Rotation of glTF contents whose vertical axis is not y, before {@link toTileset}. */
  readonly turn?: Affine | undefined;
}

/** A node of the tree. Its contents are drawn, or the child tiles that replace them. */
export interface Tile extends SceneNode {
  readonly contents: readonly TileContent[];
  readonly children: readonly Tile[];
  /** Whether the tile's contents are drawn in addition to its children (refinement `ADD`). */
  readonly isAdded: boolean;
  /** Geometric error in units of the outermost tileset; Infinity if unknown. */
  readonly error: number;
  /** Place of an implicit tile whose subtree has not been read. The result replaces this tile. */
  readonly implicit?: ImplicitTile | undefined;
}
