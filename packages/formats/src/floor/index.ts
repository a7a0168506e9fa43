/** Walkable floor of a scene: finds it from splats or voxels, stores it in `.floor` files, and walks on it. */
export { extinctionOf, type ExtinctionGrid, type GridOptions, type UpFrame, type VoxelGrid } from './extinction.js';
export { floorOf, makeFloorMap, type FloorOptions } from './floor.js';
export { solidsOf } from './solids.js';
export { isVoxelPath, readVoxels, voxelTreePath, type SolidGrid, type VoxelFiles } from './voxels.js';
export { decodeFloorMap, encodeFloorMap, floorAt, stepOn, type FloorMap } from './floor-map.js';
export { wayTo } from './way.js';
