export { cpuPainter, cpuScorer } from './cpu-raster.js';
export { economise, type Economised, type EconomiseOptions } from './economise.js';
export { GpuScorer } from './gpu-scorer.js';
export { LiveMask, heaviest, type LiveMaskOptions, type MaskedScene, type ViewSize } from './live-mask.js';
export {
  contributionOfShare,
  economical,
  parseEconomy,
  parseEconomyGoal,
  type EconomyGoal,
  type EconomyShare,
} from './mask.js';
export { decibels, meanSquare, Studio, type Image, type Painter } from './measure.js';
export { reduce, type Cut, type ReducedCloud } from './reduce.js';
export { scoreSplats, type Scores } from './score.js';
export type { ContributionScorer } from './scorer.js';
export { dealtViewsAround, dealViews, viewsAround, viewsBetween, type DealtViews, type ViewOptions } from './views.js';
export { encodingsFor, type Encoding } from './write/index.js';
