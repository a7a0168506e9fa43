/** Dynamic quality, for tests. */
export { DisplayInterval, quantile } from '../../../packages/element/src/dynamic-quality/display-interval.js';
export {
  DynamicQualityController,
  type DynamicQualityOptions,
  type FramePlan,
} from '../../../packages/element/src/dynamic-quality/dynamic-quality-controller.js';
export { addLoss, decibelsOf } from '../../../packages/element/src/dynamic-quality/loss.js';
export { nextQuality } from '../../../packages/element/src/dynamic-quality/next-quality.js';
export {
  levelsForSize,
  MIN_PSNR,
  QUALITY_LEVELS,
  type QualityLevel,
} from '../../../packages/element/src/dynamic-quality/quality-levels.js';
export {
  INITIAL_QUALITY,
  waitForRest,
  type QualityState,
} from '../../../packages/element/src/dynamic-quality/start.js';
export { SplatBudgets, type BudgetedScene } from '../../../packages/element/src/dynamic-quality/splat-budgets.js';
