import type { SplatShader } from '@gaussian-splat/renderer/modifiers';
import type { ReactiveControllerHost, ReactiveElement } from 'lit';
import type { SharedDevice } from '../gpu/shared-device.js';
import type { SceneLimits, SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';

/** Services shared by all elements of a page. */
export interface Services {
  readonly sharedDevice: SharedDevice;
  readonly sceneLoader: SceneLoader;
  /** Milliseconds after which an element that was removed from the document releases its scene. */
  readonly releaseDelay: number;
  /** Maximum GPU memory of one scene, bytes; null for a limit that depends on the device. */
  readonly memoryBudget: number | null;
  readonly sceneLimits: SceneLimits;
  /** URL of the folder with ONNX Runtime's files; null for the folder next to the bundle. */
  readonly runtimeLocation: string | null;
  /** Rewrites the addresses of scenes before they are fetched. */
  readonly urlModifier: ((url: string) => string) | null;
}

/** The source that the element's attributes request. */
export interface Source extends Pick<SceneRequest, 'splats'> {
  readonly src: string | Blob | null;
  readonly contract: unknown;
  /** URLs of further models, separated by spaces: each receives the Gaussians of the previous one. null for none. */
  readonly chain: string | null;
  readonly postprocess: string | null;
  /** Whether the file is shown as triangle meshes, without splats. */
  readonly isMesh?: boolean;
}

/** The element as its features see it: its properties of playback and of effects besides those of HTMLElement. */
export interface ViewerElement extends ReactiveControllerHost, HTMLElement, Pick<ReactiveElement, 'isUpdatePending'> {
  readonly splatShader: SplatShader | null;
  readonly revealProgress: number | null;
  readonly currentTime: number;
  readonly playbackRate: number;
  readonly paused: boolean;
  readonly seeking: boolean;
  readonly readyState: number;
}

/**
 * Interface of the element for its {@link Viewer}: its source, and the parts of its shadow tree after the first
 * rendering.
 */
export interface ElementHost {
  readonly services: Services;
  readonly source: Source & { readonly splatShader?: unknown };
  part<T extends HTMLElement>(selector: string): T | null;
  warn(sentence: string): void;
}
