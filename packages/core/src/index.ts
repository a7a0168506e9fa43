export * from './bounds.js';
export {
  cameraFromCalibration,
  DEFAULT_FAR,
  DEFAULT_NEAR,
  lookAt,
  validateCamera,
  type CalibratedView,
  type Camera,
} from './camera.js';
export * from './projections.js';
export * from './errors.js';
export * from './credits.js';
export * from './gaussian-cloud.js';
export * from './half.js';
export * from './linear.js';
export * from './lazy.js';
export * from './load-module.js';
export * from './scene-host.js';
export * from './vector.js';
