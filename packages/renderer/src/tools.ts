/**
 * Packing, levels of detail, LOD pages and timers as individual functions: for tools, and for packages that build on
 * the renderer.
 */
export { constants } from './generated/shaders.js';
export { levelOf, levelsAbove } from './levels/build-levels.js';
export {
  boundLevel,
  detailRows,
  DETAIL_NUMBERS,
  ENDLESS,
  leafErrors,
  parentErrors,
  type ChunkErrors,
} from './levels/chunk-detail.js';
export { packFiller, packLevelGeometry, packLevelSh } from './levels/pack-level.js';
export { chunksOf, emptyLevel, FACTOR_NUMBERS, leafLevel, shNumbers, type SplatLevel } from './levels/splat-level.js';
export { CHUNK_NUMBERS } from './pack/words.js';
export { codesAlong, curveThrough, isOfPlanes, sampleAxis, type Curve } from './pack/morton.js';
export { AuxiliaryOutputs } from './rasterizers/auxiliary-outputs.js';
export { packedOrder, usableIndices } from './pack/pack.js';
export { recentered } from './pack/recenter.js';
export { type ShPrecision } from './pack/words.js';
export { choosePrecision, noiseIn, SCALE_BIAS, SCALE_STEPS } from './pack/sh.js';
export { shReader } from './pack/unpack.js';
export { decodePage } from './streaming/decode-page.js';
export { finestPages } from './streaming/finest-pages.js';
export { pageLayout, type DetailManifest } from './streaming/manifest.js';
export { cloudOfChunks, type PageChunks } from './streaming/page-cloud.js';
export * from './streaming/page-coding.js';
export { listPages, type InstanceList } from './streaming/page-list.js';
export {
  CENTER_ROUNDING,
  directionIn2,
  directionIn3,
  packQuantizedChunk,
  QUANTIZED_CHUNK_WORDS,
  readRow,
  ROW_CODES,
  rowLengths,
  widenReach,
} from './streaming/quantized-geometry.js';
export { type ProbeAnswer, type ProbePoint } from './depth-probe.js';
export {
  pickedSurface,
  placeOfSurface,
  surfacePoints,
  type PickedPlace,
  type PickedSurface,
} from './picked-surface.js';
export { type ProbedSplat } from './probed-splat.js';
export { type GaussianBlock, type PageRequests } from './gaussian-scene.js';
export { QueueClock, type WorkTime } from './gpu/queue-clock.js';
export { buildPackedLevels, packWithDetail, type PackedLevels } from './levels/packed-levels.js';
export { packLevelRuns } from './streaming/pack-runs.js';
export { layoutLevels, type LevelBox, type LevelPage, type LevelScene } from './streaming/level-pages.js';
export { levelSource, packLevelPage } from './streaming/level-source.js';
export { NodePacker } from './streaming/node-packer.js';
export { packNodes, type NodeContent, type NodePage, type RunError } from './streaming/pack-nodes.js';
export { MAX_UNPACKED, PageUnpacker, UNPACKED_AT_ONCE } from './streaming/page-unpacker.js';
export { folderSource, type FetchPage } from './streaming/page-source.js';
export { treeSource, type FetchedNode, type OpenedTree } from './streaming/tree-source.js';
export { hasMemory } from './gpu/has-memory.js';
export { readPacked } from './pack/packed-scene.js';
export type { PackedGaussians, PackedHead, PackOptions } from './pack/pack.js';
export { sceneBytes, type PackedPortion } from './gaussian-buffers.js';
export { ArrayGaussians, type ArrayLayout } from './array-gaussians.js';
export { boundsOfWorld } from './world-bounds.js';
export { GEOMETRY_WORDS, shWords } from './pack/words.js';
export { type Threads } from './stages/stage.js';
export { bytesPerSplat, type Reservation } from './memory-ledger.js';
export { boundsOfPacked, JoinedBlocks, type RowLayout, type SortedBlock } from './pack/joined-blocks.js';
export { packCloud, prepareToPack, type CloudReceiver } from './pack/pack-cloud.js';
export { packerCode, type PackableRows } from './pack/packer-memory.js';
export { type BlockBuffers, RowPacker } from './pack/row-packer.js';
export { previewOf } from './pack/row-preview.js';
export { readBack, readBackWith, type ReadPart } from './gpu/read-back.js';
export { sortByKey } from './pack/radix-sort.js';
export { RankedHeap } from './ranked-heap.js';
export { budgetBytes } from './budget-bytes.js';
export { maxSplatBudget } from './max-splat-budget.js';
export { untilItHasRoom } from './until-it-has-room.js';
export { faultsOf } from './variants.js';
export { packAnimation, type Motions, type PackedAnimation } from './pack/pack-animated.js';
