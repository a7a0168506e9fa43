/** The walkable floor of a scene: derived from its splats, stored in `.floor` files, used for walking. */
export { extinctionOf, type ExtinctionGrid, type GridOptions, type UpFrame, type VoxelGrid } from './extinction.js';
export { floorOf, makeWalkMap, type FloorOptions } from './floor.js';
export { solidsOf } from './solids.js';
export { isVoxelPath, readVoxels, voxelTreePath, type SolidGrid, type VoxelFiles } from './voxels.js';
export { decodeWalkMap, encodeWalkMap, floorAt, stepOn, wayTo, type WalkMap } from './walk-map.js';
