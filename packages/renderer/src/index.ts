export { capture } from './capture.js';
export { deviceDescriptor } from './device.js';
export { GaussianBuffers, type GaussianPage } from './gaussian-buffers.js';
export { PassTimer, type PassTime } from './gpu/pass-timer.js';
export { packGaussians, type PackedGaussians } from './pack.js';
export type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
export { Renderer, type FrameRequest, type RendererOptions } from './renderer.js';
export type { FrameStatistics } from './statistics.js';
