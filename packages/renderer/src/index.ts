export { capture, type CaptureRequest } from './capture.js';
export { Viewpoint } from './checked-viewpoint.js';
export { createRenderer } from './choice/choose.js';
export { autotune, startVariants, type AutotuneOptions, type StartOptions } from './choice/choose.js';
export type { AutotuneStore } from './choice/kept-choice.js';
export type { ProbeAnswer, ProbePoint } from './depth-probe.js';
export { DynamicGaussians, type DynamicGaussiansOptions } from './dynamic-gaussians.js';
export { GaussianBuffers, type UploadOptions } from './gaussian-buffers.js';
export type { GaussianPage, GaussianScene, PageRequests } from './gaussian-scene.js';
export { PassTimer, type FrameTimer, type PassTime } from './gpu/pass-timer.js';
export { QueueClock, type WorkTime } from './gpu/queue-clock.js';
export { SpanTimer } from './gpu/span-timer.js';
export { QUALITIES, type PerFrameSettings, type RenderSettings, type Quality } from './render-settings.js';
export { LinearColours } from './linear-colours.js';
export { buildPackedLevels, packWithDetail, type PackedLevels } from './detail/packed-levels.js';
export { packLevelRuns } from './detail/pack-runs.js';
export { DetailedGaussians } from './detail/detailed-gaussians.js';
export {
  buildDetailTree,
  cutPages,
  manifestOf,
  packPage,
  type BuiltPage,
  type DetailTree,
  type DetailTreeOptions,
} from './detail/build-pages.js';
export { decodePage } from './detail/decode-page.js';
export {
  codingOf,
  PageEncoder,
  USUAL_STEPS,
  type PageEncoderOptions,
  type PageSteps,
  type WrittenCoding,
} from './detail/encode-page.js';
export type { Deflate } from './detail/page-planes.js';
export { cloudOfChunks, type PageChunks } from './detail/page-cloud.js';
export type { CodedFile, PageCoding } from './detail/page-coding.js';
export { roundedBy, SeenRounder } from './detail/round-harmonics.js';
export { weighSplats, type SeenSplats } from './detail/seen-splats.js';
export { treeOfCopies } from './detail/tile-tree.js';
export { StreamedGaussians, type PoolOptions, type StreamOptions } from './detail/streamed-gaussians.js';
export type { FetchPage, PageSource, StreamedScene } from './detail/page-source.js';
export { layOutLevels, type LevelBox, type LevelPage, type LevelScene } from './detail/level-pages.js';
export { levelSource, packLevelPage } from './detail/level-source.js';
export { checkManifest, type DetailManifest } from './detail/manifest.js';
export { packedOrder, packGaussians, type PackedGaussians, type PackOptions } from './pack/pack.js';
export { readPacked } from './pack/packed-scene.js';
export type { ShPrecision } from './pack/sh.js';
export type { AccumulationFormat, AuxiliaryOutputs, AuxiliaryFrame, RasterizerName } from './rasterizers/rasterizer.js';
export { FilteredFrame, type ModelImage } from './pictures/filtered-frame.js';
export { ImageTensor, type ImageFit, type ImageShape } from './pictures/picture-tensor.js';
export {
  settings,
  type Composer,
  type FrameSettings,
  type FrameTarget,
  type Rgba,
  type Target,
  type TargetView,
} from './frame-target.js';
export { Renderer } from './renderer.js';
export { deviceDescriptor } from './requirements.js';
export { UncheckedViewpoint, type View, type ViewpointOptions } from './viewpoint.js';
export { boundsOfWorld } from './world-bounds.js';
export { Placement, World, type Box, type Placed } from './world.js';
export type { FrameRequest, RendererOptions } from './frame-request.js';
export { SceneDepth, type HostDepth, type SceneDepthOptions } from './scene-depth.js';
export { SequenceGaussians } from './sequence-gaussians.js';
export type { FrameStatistics } from './statistics.js';
export type { Threads } from './stages/plan.js';
export type { Variants } from './variants.js';
export { bytesPerSplat, MemoryLedger, type Reservation } from './memory-ledger.js';
export {
  joinShares,
  packShare,
  SHARE_SPLATS,
  type JoinedShares,
  type PackedShare,
  type ShareFacts,
} from './pack/shares.js';
