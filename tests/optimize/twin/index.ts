/** The optimizer's GPU work in plain code. */
export { drawPlainly } from './draw-plainly.js';
export { PaintedEvaluator } from './painted-evaluator.js';
export { Studio } from './painter.js';
export { cpuPainter, cpuScorer } from './raster.js';
export { scoreSplats } from './score.js';
export type { ContributionScorer } from './scorer.js';
