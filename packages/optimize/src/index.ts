export {
  optimizePassing,
  optimizeWithin,
  FIRST_PSNR,
  type OptimizedBySearch,
  type OptimizedPassing,
  type Try,
} from './search-decibels.js';
export { optimize, type Optimized, type OptimizeOptions } from './optimize.js';
export type { CutFigures, Evaluator, EvaluationViews } from './evaluator.js';
export { GpuEvaluator, type GpuEvaluatorOptions } from './gpu/gpu-evaluator.js';
export { MergingEvaluator, type MergingOptions } from './merge/merging-evaluator.js';
export { decibels, meanSquare, type Image } from './measure.js';
export type { TaskPool } from './parts/task-pool.js';
export { degreesOf, splatsOf, type Cut, type ReducedCloud } from './reduce.js';
export { RefiningEvaluator, type RefiningOptions } from './refine/refining-evaluator.js';
export type { OptimizerOptions } from './refine/scene-fitter.js';
export type { ReducedSh, Ranking, Scores } from './score.js';
export {
  dealOwnViews,
  viewSplitAround,
  dealtViewsOfVisitors,
  splitViews,
  viewsAround,
  viewsBetween,
  type ViewSplit,
} from './views.js';
export { changeFormat, type ChangeFormatOptions } from './write/change-format.js';
export { encodingsFor, lossesIn, type Encoding } from './write/index.js';
export { findSteps, type FindStepsOptions, type Steps } from './steps.js';
export { writeSog, type EncodeWebp, type SogOptions, type SogSteps } from './write/sog.js';
export { isLodIndex, writeStreamedSog } from './write/streamed-sog.js';
export { filesOfZip } from './write/zip.js';
export { codeClip, codeClipRange, type CodeClipOptions, type CodedClip } from './clip/code-clip.js';
export type { ClipStore } from './clip/clip-store.js';
export { drawOn, type DrawFrame } from './clip/frame-judges.js';
