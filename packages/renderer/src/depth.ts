/** Depth, coverage and identity of each pixel as data, with pinhole, orthographic and fisheye cameras. */
export { renderDepth, type DepthImage, type DepthRequest } from './render-depth.js';
export { renderFisheye, type FisheyeCamera, type FisheyeRequest } from './render-fisheye.js';
