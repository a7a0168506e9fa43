/** The stages one by one, for tests and for those who build a pipeline of their own. */
export * from './generated/shaders.js';
export { GpuMemory } from './gpu/memory.js';
export { writeStruct } from './gpu/struct.js';
export { scaleRotationFactor } from './pack/factor.js';
export { halfBits } from './pack/half.js';
export { mortonOrder } from './pack/morton.js';
export { SH_PRECISION, shWords } from './pack/sh.js';
export { planOffsets, Scratch } from './scratch.js';
export { CompactStage } from './stages/compact.js';
export { ComposeStage } from './stages/compose.js';
export { CullChunksStage, cullGroups, CullStage } from './stages/cull.js';
export { OrderKeysStage } from './stages/order-keys.js';
export { PlanStage } from './stages/plan.js';
export { ProjectStage } from './stages/project.js';
export { ScanStage } from './stages/scan.js';
export { sortedIn, SortStage, type SortBuffers } from './stages/sort.js';
export { thinBlocks, ThinStage, type ThinBuffers } from './stages/thin.js';
export { cameraValues } from './view.js';
