/** Shadows, for tests. */
export {
  SHADOW_PIXELS,
  shadowSplats,
  takeShadow,
  type Subject,
  type TakeAlpha,
} from '../../../packages/element/src/shared/shadow-map.js';
export { toViewer } from '../../../packages/element/src/viewer/camera/orbit.js';
