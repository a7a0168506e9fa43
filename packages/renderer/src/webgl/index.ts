/** WebGL 2 backend for browsers without WebGPU: whole scenes, sorted on the CPU, with the same shaders. */
export { drawn, GlClock } from './gl-clock.js';
export { glBytes, GlGaussians, positionsIn, type GlGaussianFacts, type RunGl } from './gl-gaussians.js';
export { GlHost, type GlHostOptions } from './gl-host.js';
export type { GlHostFrame } from './host-depth.js';
export { HostedSplats, type GlHostDrawing } from './hosted-splats.js';
export type { GlStreamOptions } from './gl-stream.js';
export {
  blendable,
  GlRenderer,
  type GlAccumulationFormat,
  type GlFrameRequest,
  type GlFrameTarget,
  type GlQuads,
  type GlQuadsFrame,
} from './gl-renderer.js';
export type { PickedPlace } from '../picked-surface.js';
export { OverdrawLimit } from '../overdraw.js';
export { sortSplats, type SortAnswer, type SortRequest } from './sort-splats.js';
export { areasIn } from './splat-areas.js';
export { DATA_WIDTH, SOURCE_DIGEST } from './shaders.js';
export { distanceView, isSameImage, isSameView, orderView, SplatOrder, type OrderView } from './splat-order.js';
