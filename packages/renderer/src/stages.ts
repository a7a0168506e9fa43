/** The individual stages, for tests and for custom pipelines. */
export { CapacityMonitor, CountBuffers, MIN_CAPACITY } from './capacity.js';
export { CapacityHistory, type Capacity, type SampledFrame } from './capacity-history.js';
export { passesSelfTest } from './autotune/self-test.js';
export { packSpheres, sphereCloud } from './autotune/spheres.js';
export { ROUNDS } from './autotune/search.js';
export { probeDepthStage } from './depth-probe.js';
export * from './generated/budget-shaders.js';
export * from './generated/depth-shaders.js';
export * from './generated/linear-shaders.js';
export * from './generated/rectangle-shaders.js';
export * from './generated/live-shaders.js';
export * from './generated/probe-shaders.js';
export * from './generated/quantized-shaders.js';
export * from './generated/shaders.js';
export * from './generated/streamed-shaders.js';
export { BUFFER_USAGE, dispatchGrid, kernelOf, rareKernelOf, TEXTURE_USAGE, type ComputeKernel } from './gpu/kernel.js';
export { PACKED, type GeometryReading } from './geometry-reading.js';
export { BufferOwner, GpuMemory, withMemoryCheck } from './gpu/memory.js';
export { submitPass, uniformWith, writeUniform } from './gpu/one-off.js';
export { BLOCK_BYTES, StagingBelt } from './gpu/staging-belt.js';
export { writeStruct, type StructLayout, type StructValues } from './gpu/struct.js';
export { pageCapacity } from './gaussian-buffers.js';
export { scaleRotationFactor } from './pack/factor.js';
export { aheadMs, CameraMotion } from './streaming/camera-motion.js';
export { DETAIL_NUMBERS, DETAIL_PLACES } from './levels/chunk-detail.js';
export { buildLevels } from './levels/build-levels.js';
export { emptyList, listPages, NONE, putBelow, type PageList } from './streaming/page-list.js';
export * as splatRows from './levels/splat-rows.js';
export { BRIDGED, DetailTable } from './streaming/detail-table.js';
export { pageLayout, SLOT_CHUNKS } from './streaming/manifest.js';
export { packQuantizedChunk, QUANTIZED_CHUNK_WORDS } from './streaming/quantized-geometry.js';
export { QUANTIZED } from './streaming/quantized-reading.js';
export { PagePool, poolBytes, poolSize } from './streaming/page-pool.js';
export { MAX_FETCHES, MAX_TRANSIT_BYTES, PageStreamer } from './streaming/page-streamer.js';
export { folderSource } from './streaming/page-source.js';
export { Residency } from './streaming/residency.js';
export { MAX_UPLOAD_BYTES, UPLOAD_SHARE, UploadBudget } from './streaming/upload-budget.js';
export { halfBits } from './pack/half.js';
export { isOfPlanes, mortonOrder } from './pack/morton.js';
export { recentered } from './pack/recenter.js';
export { SH_PRECISION, shWords } from './pack/words.js';
export { SceneBuffers } from './scene-buffers.js';
export { Scratch } from './scratch.js';
export { ComposeStage } from './stages/compose.js';
export { detailBudgetOn } from './stages/detail-budget.js';
export { ingestStage } from './stages/ingest.js';
export { sortedIn, SortStage, type SortBuffers } from './stages/sort.js';
export {
  compactStage,
  cullChunksStage,
  cullGroups,
  cullStage,
  planStage,
  projectStage,
  scanBytes,
} from './stages/stage.js';
export { leafLevel, type SplatLevel } from './levels/splat-level.js';
export { cameraValues } from './view.js';
export { Ingest } from './generated/live-layouts.js';
export { fewTilesOn } from './rasterizers/few-tiles-loader.js';
export { FewTiles } from './rasterizers/few-tiles.js';
export { orderOn } from './pixel-order-loader.js';
export { PixelOrder } from './rasterizers/pixel-order.js';
