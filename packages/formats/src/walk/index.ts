/** The walkable floor of a scene: made from its splats, stored in `.floor` files, walked on. */
export { extinctionOf, type ExtinctionGrid, type GridOptions, type UpFrame } from './extinction.js';
export { floorOf, makeWalkMap, type FloorOptions } from './floor.js';
export { solidsOf } from './solids.js';
export { decodeWalkMap, encodeWalkMap, floorAt, stepOn, wayTo, type WalkMap } from './walk-map.js';
