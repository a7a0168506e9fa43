/** The stages one by one, for tests and for those who build a pipeline of their own. */
export * from './generated/shaders.js';
export { halfBits } from './gpu/half.js';
export { GpuMemory } from './gpu/memory.js';
export { writeStruct } from './gpu/struct.js';
export { planOffsets, Scratch } from './scratch.js';
export { CompactStage } from './stages/compact.js';
export { ComposeStage } from './stages/compose.js';
export { cullGroups, CullStage } from './stages/cull.js';
export { PlanStage } from './stages/plan.js';
export { ProjectStage } from './stages/project.js';
export { ScanStage } from './stages/scan.js';
export { sortedIn, SortStage, type SortBuffers } from './stages/sort.js';
export { cameraValues } from './view.js';
