import type { Affine } from './gltf/nodes.js';

/** A file of a tile. */
export interface TileContent {
  /** URI from the tileset, with its query. */
  readonly uri: string;
  /** Transform from the coordinates of the tile (z up) to those of the tileset. */
  readonly toTileset: Affine;
  /** Rotation of glTF contents whose vertical axis is not y, before {@link toTileset}. */
  readonly turn?: Affine | undefined;
}

/** A node of the tree. Its contents are drawn, or the child tiles that replace them. */
export interface Tile {
  readonly contents: readonly TileContent[];
  readonly children: readonly Tile[];
  /** Whether the tile's contents are drawn in addition to its children (refinement `ADD`). */
  readonly isAdded: boolean;
}
