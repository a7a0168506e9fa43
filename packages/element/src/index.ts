/** Registers `<gaussian-splat>`. For the class alone, without registration, import `@gaussian-splat/element/element.js`. */
import { GaussianSplatElement } from './element.js';

export type { ElementError, ElementErrorCode } from './errors.js';
export type {
  CameraChangeDetail,
  CameraChangeSource,
  FallbackDetail,
  GaussianSplatEventMap,
  LoadDetail,
} from './events.js';
export { GaussianSplatElement, type SceneStatistics } from './element.js';
export { CameraOrbit, CameraTarget, FieldOfView } from './camera/values.js';
export type { ControlValues, Numbers, Picture } from './live/values.js';
export { SharedDevice, type DeviceLease } from './gpu/shared-device.js';

// Two copies of this module on one page, or a server without custom elements, must not fail.
if (globalThis.customElements && !customElements.get('gaussian-splat')) {
  customElements.define('gaussian-splat', GaussianSplatElement);
}
