export { capture, type CaptureRequest } from './capture.js';
export {
  autotune,
  pickInitialVariants,
  prepareInitialVariants,
  type AutotuneOptions,
  type StartOptions,
} from './autotune/autotune.js';
export type { AutotuneStore } from './autotune/store.js';
export { DynamicGaussians, type DynamicGaussiansOptions } from './dynamic-gaussians.js';
export { GaussianBuffers, type UploadOptions } from './gaussian-buffers.js';
export type { GaussianScene } from './gaussian-scene.js';
export { PassTimer, type FrameTimer } from './gpu/pass-timer.js';
export { QUALITIES, type PerFrameSettings, type RenderSettings, type Quality } from './render-settings.js';
export { LinearColors } from './linear-colors.js';
export { Stereo, type StereoFrame, type StereoView } from './stereo.js';
export { Rectangle, type RectangleBounds } from './rectangle.js';
export { DetailedGaussians } from './levels/detailed-gaussians.js';
export type { StreamProgress } from './streaming/progress.js';
export { StreamedGaussians, type PoolOptions, type StreamOptions } from './streaming/streamed-gaussians.js';
export type { PageSource, StreamedScene } from './streaming/page-source.js';
export { checkManifest, type DetailManifest } from './streaming/manifest.js';
export { packGaussians, type PackedGaussians, type PackOptions } from './pack/pack.js';
export type { AccumulationFormat, AuxiliaryFrame, RasterizerName } from './rasterizers/rasterizer.js';
export { FilteredFrame, type ModelImage } from './images/filtered-frame.js';
export { ImageTensor, type ImageFit, type ImageShape } from './images/image-tensor.js';
export {
  settings,
  type Compositor,
  type FrameSettings,
  type FrameTarget,
  type Rgba,
  type Target,
  type TargetView,
} from './frame-target.js';
export { deviceDescriptor } from './requirements.js';
export { Viewpoint, type ViewpointOptions } from './viewpoint.js';
export { Placement, World, type Box, type Placed } from './world.js';
export { SceneDepth, type HostDepth, type SceneDepthOptions } from './scene-depth.js';
export { SequenceGaussians } from './sequence-gaussians.js';
export type { FrameStats } from './frame-stats.js';
export type { Variants } from './variants.js';
export { MemoryLedger } from './memory-ledger.js';
export { ANIMATION_SLOTS, STILL_SLOT, AnimatedGaussians, type AnimatedRoom } from './animated-gaussians.js';
