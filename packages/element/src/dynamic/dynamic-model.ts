import type { Camera } from '@gaussian-splat/core';
import type { DynamicGaussians } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../camera/settings.js';
import type { GeneratorInput } from './inputs.js';
import type { SceneLimits } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { ReadControls } from './values.js';

/** State of a model that a page sets, apart from the camera. Names are case-insensitive. */
export interface DynamicState extends ReadControls {
  readonly timeSeconds: number;
  /** Flattened; undefined for the model's rest pose. */
  readonly pose: readonly number[] | undefined;
}

/** Listeners of a model. */
export interface DynamicListeners {
  /** Called when a frame for a time is ready to be drawn. */
  readonly onFrame: (timeSeconds: number) => void;
  /** Called when the frame at a time is shown by the frame being drawn. */
  readonly onShown: (timeSeconds: number) => void;
  /** Called when a run fails; the last good frame stays. */
  readonly onError: (error: unknown) => void;
  /** Called when the model runs on the CPU. */
  readonly onFallback: (reason: string) => void;
  /** Called when an input of the next run has arrived: an image. */
  readonly onInput: () => void;
}

/** Changes the Gaussians of a scene over time: a generator, or a sequence of files. */
export interface Timeline {
  /** Current bounds of the Gaussians; absent if those of the first frame apply. */
  readBounds?(): Promise<SceneBounds>;
  /** Bounds of the Gaussians: those of the contract, or of the last runs. */
  readonly bounds?: SceneBounds;
  /** Duration in seconds; Infinity if the contract declares none. */
  readonly duration: number;
  /** Inputs that the page may set; absent if there are none. */
  readonly inputs?: readonly GeneratorInput[];
  /** Inputs that `control-NAME` sets; absent if there are none. */
  readonly settable?: readonly string[];
  /** Requests the Gaussians of a state; the latest request wins, and an unchanged one costs nothing. */
  request(state: DynamicState, camera: Camera): void;
  /**
   * Returns the first time from `timeSeconds` on whose frame is not loaded, or Infinity; absent if the clock never waits.
   */
  loadedUntil?(timeSeconds: number): number;
  /** [start, end] of the times that need no more bytes, seconds; absent for all. */
  readonly buffered?: readonly (readonly [start: number, end: number])[];
  close(): void;
}

/** The generator of a scene, with the first frame in its Gaussians. */
export interface DynamicModel extends Timeline {
  readonly gaussians: DynamicGaussians;
  readonly bounds: SceneBounds;
}

/** Location of a generator, and the state of its first frame. */
export interface DynamicRequest {
  readonly url: string;
  /** Addresses of models that each receive the Gaussians of the previous one. */
  readonly chain?: readonly string[];
  /** Address of a contract, its JSON text, or the contract itself; null for that of the model or its sidecar. */
  readonly contract?: unknown;
  readonly credentials: RequestCredentials;
  /** Upper limit of the GPU memory of the Gaussians in bytes; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** The element that shows it: only code that is loaded for generators reads its attribute `gpu-check`. */
  readonly element: HTMLElement;
  /** Folder of the runtime's files; null for the one beside the bundle. */
  readonly runtimeLocation: string | null;
  /** Provides workers: one that reads the header, and one that runs a model on the CPU on request. */
  readonly loader: SceneLoader;
  /** Limits of the model's load. */
  readonly limits?: SceneLimits | undefined;
  readonly state: () => DynamicState;
  /** Whether playback restarts at its end. */
  readonly loops: () => boolean;
  /** False if controls may belong to another model, which then reports unknown ones. */
  readonly ownsControls: () => boolean;
  /** A camera for the bounds that the contract declares, or for unknown ones. */
  readonly camera: (bounds: SceneBounds | undefined) => Camera;
  readonly listeners: DynamicListeners;
}
