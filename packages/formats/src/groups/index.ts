/** Objects of a scene: groups of splats by a property of its file. */
export { GROUP_PROPERTIES, readGroups, type GroupedScene, type ReadGroupsOptions } from './read-groups.js';
export { SplatGroups, type GroupChanges, type SplatGroup } from './splat-groups.js';
