export * from './bounds.js';
export * from './camera.js';
export * from './errors.js';
export * from './gaussian-cloud.js';
export * from './linear.js';
export * from './vector.js';
export * from './onnx/index.js';
export * from './contract/index.js';
