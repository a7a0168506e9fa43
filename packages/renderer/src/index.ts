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
export { buildPackedLevels, packWithDetail, type PackedLevels } from './levels/packed-levels.js';
export { packLevelRuns } from './streaming/pack-runs.js';
export { DetailedGaussians } from './levels/detailed-gaussians.js';
export { decodePage } from './streaming/decode-page.js';
export type { CodedFile, PageCoding } from './streaming/page-coding.js';
export { StreamedGaussians, type PoolOptions, type StreamOptions } from './streaming/streamed-gaussians.js';
export type { FetchPage, PageSource, StreamedScene } from './streaming/page-source.js';
export { layOutLevels, type LevelBox, type LevelPage, type LevelScene } from './streaming/level-pages.js';
export { levelSource, packLevelPage } from './streaming/level-source.js';
export { checkManifest, type DetailManifest } from './streaming/manifest.js';
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
