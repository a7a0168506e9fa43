/** Drawing with WebGL 2 where a browser has no WebGPU: whole scenes, sorted on a processor, by the same shaders. */
export { drawn, GlClock } from './gl-clock.js';
export { glBytes, GlGaussians, type GlGaussianFacts } from './gl-gaussians.js';
export { blendable, GlRenderer, type GlAccumulationFormat, type GlFrameRequest } from './gl-renderer.js';
export { DATA_WIDTH, SOURCE_DIGEST } from './shaders.js';
export { isSameView, orderView, SplatOrder, type OrderView } from './splat-order.js';
