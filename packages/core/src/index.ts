export * from './bounds.js';
export {
  cameraFromCalibration,
  DEFAULT_FAR,
  lookAt,
  validateCamera,
  type CalibratedView,
  type Camera,
} from './camera.js';
export * from './projections.js';
export { GaussianSplatError, type ErrorCode, type ErrorData, type ErrorDetails } from './errors.js';
export * from './credits.js';
export * from './gaussian-cloud.js';
export * from './half.js';
export * from './linear.js';
export * from './linear-determinant.js';
export * from './lazy.js';
export * from './load-module.js';
export * from './scene-host.js';
export * from './to-degree.js';
export * from './vector.js';
