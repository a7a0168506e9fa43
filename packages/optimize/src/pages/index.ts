/** Writers of folders of LOD pages, which the renderer streams and docs/lod-format.md describes. */
export { fewerSplats } from '../merge/fewer-splats.js';
export {
  buildDetailTree,
  cutPages,
  manifestOf,
  packPage,
  type BuiltPage,
  type DetailTree,
  type DetailTreeOptions,
} from './build-pages.js';
export {
  codingFor,
  PageEncoder,
  DEFAULT_STEPS,
  type PageEncoderOptions,
  type PageSteps,
  type WrittenCoding,
} from './encode-page.js';
export { findPageSteps, type FoundPageSteps, type PageStepsOptions } from './find-page-steps.js';
export { placesOnGrid, writePages, type FolderCoding, type PageFolderOptions } from './page-folder.js';
export type { Deflate } from './page-planes.js';
export { HarmonicRounder } from './round-harmonics.js';
export { visibilityWeights, type SplatVisibility } from './splat-visibility.js';
export { instancedTree } from './tile-tree.js';
export { packTop, SceneCells } from './cells.js';
export {
  countShells,
  keysOf,
  orderBy,
  planScene,
  positionsFrom,
  sampleStep,
  type ScenePlan,
  type SplatKeys,
} from './scene-plan.js';
export { MAX_SHELLS, placeShells, type ShellCounts, type ShellPlaces } from './shell-order.js';
