/**
 * Registers `<gaussian-splat>`. For the class alone, without registration, import `@gaussian-splat/element/element.js`.
 */
import { GaussianSplatElement } from './viewer/element.js';

export type { ElementError, ElementErrorCode } from './viewer/errors.js';
export type {
  CameraChangeDetail,
  CameraChangeSource,
  FallbackDetail,
  GeneratorMemoryDetail,
  GaussianSplatEventMap,
  HotspotVisibilityDetail,
  LoadDetail,
  PreviewDetail,
  VisibilityDetail,
} from './viewer/events.js';
export { GaussianSplatElement } from './viewer/element.js';
export type * from './viewer/feature-table.js';
export type { SceneStats } from './viewer/stats.js';
export type { DynamicQualityReport } from './dynamic-quality/dynamic-quality-controller.js';
export type { SettableProperties } from './viewer/media.js';
export type { CameraView, LookView, MatrixView, OrbitView, TrainerView } from './viewer/camera/camera-view.js';
export type { Easing } from './viewer/camera/path.js';
export type { SplatShader, SplatUniform } from '@gaussian-splat/renderer/modifiers';
export type { NamedView } from './viewer/camera/read-views.js';
export type { Loading, Navigation, Reveal, TouchAction, WheelZoom } from './viewer/attributes.js';
export type { ViewName } from './viewer/camera/spoken.js';
export type { A11yStrings } from './viewer/strings.js';
export { CameraOrbit, CameraTarget, FieldOfView, ScenePoint, type PickedPoint } from './viewer/camera/values.js';
export type { SceneBox } from './viewer/scene-queries.js';
export { SceneTimeRanges } from './viewer/time-ranges.js';
export type { GeneratorInput } from './sources/generator/inputs.js';
export type { ControlValues, Numbers, ImageSource, ImageSources } from './sources/generator/values.js';
export type { SceneLimits } from './loading/protocol.js';
export { SharedDevice, type DeviceLease } from './gpu/shared-device.js';

const CONFIGURABLE = [
  ...([
    'runtimeLocation',
    'workerLocation',
    'urlModifier',
    'releaseDelay',
    'sharedDevice',
    'memoryBudget',
    'sceneLimits',
  ] as const),
] as const;

/** Static properties of the class that a page may set in `globalThis.GaussianSplatElement` before this module runs. */
export type GaussianSplatConfiguration = Partial<Pick<typeof GaussianSplatElement, (typeof CONFIGURABLE)[number]>>;

/**
 * Copies the statics from `globalThis.GaussianSplatElement`. Script tags without a build step cannot set them before
 * the first element is upgraded.
 */
function configure(): void {
  const given = (globalThis as { GaussianSplatElement?: GaussianSplatConfiguration }).GaussianSplatElement;
  if (typeof given !== 'object' || given === null) return;
  for (const name of CONFIGURABLE) if (given[name] !== undefined) Reflect.set(GaussianSplatElement, name, given[name]);
}

configure();

// Does not fail if the page has two copies of this module, or on a server without custom elements.
if (globalThis.customElements && !customElements.get('gaussian-splat')) {
  customElements.define('gaussian-splat', GaussianSplatElement);
}
