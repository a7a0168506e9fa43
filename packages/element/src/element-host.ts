import type { Attributes } from './attributes.js';
import type { A11yStrings } from './words.js';
import type { SharedDevice } from './gpu/shared-device.js';
import type { DynamicState } from './dynamic/dynamic-model.js';
import type { SceneLimits } from './loading/protocol.js';
import type { SceneLoader } from './loading/scene-loader.js';

/** Services shared by all elements of a page. */
export interface Services {
  readonly sharedDevice: SharedDevice;
  readonly sceneLoader: SceneLoader;
  /** How long a removed element keeps its scene, ms. */
  readonly releaseDelay: number;
  /** Maximum GPU memory of one scene, bytes; null for a limit that suits the device. */
  readonly memoryBudget: number | null;
  readonly sceneLimits: SceneLimits;
  /** Folder of ONNX Runtime's files; null for the one beside the bundle. */
  readonly runtimeLocation: string | null;
  /** Rewrites the addresses of scenes before they are fetched. */
  readonly urlModifier: ((url: string) => string) | null;
}

/** The requested source according to the element's attributes. */
export interface Source {
  readonly src: string | Blob | null;
  readonly contract: unknown;
  /** URLs with spaces between them. */
  readonly chain: string | null;
  readonly postprocess: string | null;
}

/** The current attributes of the element, and the parts of its shadow tree once rendered. */
export interface ElementHost {
  readonly attributes: Attributes;
  readonly services: Services;
  readonly source: Source & { readonly splatShader?: unknown };
  readonly strings: A11yStrings;
  readonly dynamicValues: Omit<DynamicState, 'timeSeconds'>;
  part<T extends HTMLElement>(selector: string): T | null;
  warn(sentence: string): void;
}
