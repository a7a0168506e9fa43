export type { LoweredColours } from './colour-moments.js';
export { cpuPainter, cpuScorer } from './cpu-raster.js';
export { economise, type Economised, type EconomiseOptions } from './economise.js';
export type { CutFigures, Evaluator, JudgedViews } from './evaluator.js';
export { GpuEvaluator, type GpuEvaluatorOptions } from './gpu/gpu-evaluator.js';
export { lookAround, visibleSetsDecibels, type LookAroundOptions, type ViewSize } from './look-around.js';
export { MergingEvaluator, type MergingOptions } from './merge/merging-evaluator.js';
export { decibels, meanSquare, Studio, type Image, type Painter } from './measure.js';
export { PaintedEvaluator, type PaintedEvaluatorOptions } from './painted-evaluator.js';
export type { TaskPool } from './parts/task-pool.js';
export { degreesOf, reduce, type Cut, type ReducedCloud } from './reduce.js';
export { RefiningEvaluator, type RefiningOptions } from './refine/refining-evaluator.js';
export type { Descent, Rates } from './refine/scene-fitter.js';
export { scoreSplats, type Ranking, type Scores } from './score.js';
export type { ContributionScorer } from './scorer.js';
export {
  dealtViewsAround,
  dealViews,
  viewsAround,
  viewsBetween,
  type DealtViewOptions,
  type DealtViews,
  type ViewOptions,
} from './views.js';
export { encodingsFor, type Encoding } from './write/index.js';
