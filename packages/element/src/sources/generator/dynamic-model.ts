import type { Camera, Credits } from '@gaussian-splat/core';
import type { Generator } from '@gaussian-splat/generator';
import type { DynamicGaussians } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import type { GeneratorInput } from './inputs.js';
import type { SceneLimits } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import type { ReadControls } from './values.js';

/** State that a page sets for a model, apart from the camera. Names of inputs are case-insensitive. */
export interface DynamicState extends ReadControls {
  readonly timeSeconds: number;
  /** Flattened numbers of the pose, in the format of the model's input; undefined for the rest pose of the model. */
  readonly pose: readonly number[] | undefined;
}

/** Listeners of a model. */
export interface DynamicListeners {
  /** Called when the Gaussians of a time are ready to be drawn. */
  readonly onFrame: (timeSeconds: number) => void;
  /** Called when the image that is being drawn shows the frame at a time. */
  readonly onShown: (timeSeconds: number) => void;
  /** Called when a run or a download fails. The last good frame stays visible. */
  readonly onError: (error: unknown) => void;
  /** Called with the reason when the model runs on the CPU instead of the GPU. */
  readonly onFallback: (reason: string) => void;
  /** Called when data for the next frame has arrived, such as an image, so that a frame must be requested. */
  readonly onInput: () => void;
  /** Called when the file has been replaced on its server. The new version is loaded, which then replaces this one. */
  readonly onReplaced: (error: unknown) => void;
}

/** Changes the Gaussians of a scene over time: a generator, a sequence of files, or a clip. */
export interface Timeline {
  /**
   * Reads the current bounds of the Gaussians from the GPU; absent if the bounds of the first frame apply to all
   * frames.
   */
  readBounds?(): Promise<SceneBounds>;
  /** Bounds of the Gaussians, as the contract or the file declares them, otherwise as measured in the last runs. */
  readonly bounds?: SceneBounds;
  /** Credits that the contract or the manifest declares. */
  readonly credits?: Credits | undefined;
  /** Duration in seconds; Infinity if the contract declares none, NaN if time has no effect. */
  readonly duration: number;
  /** Inputs that the page may set; absent if there are none. */
  readonly inputs?: readonly GeneratorInput[];
  /** Names of the inputs that `control-NAME` sets; absent if there are none. */
  readonly settable?: readonly string[];
  /** The generator, whose Gaussians a post-processor may take; absent for files. */
  readonly generator?: Generator;
  /** Requests the Gaussians of a state. The latest request wins, and a request of the same state costs nothing. */
  request(state: DynamicState, camera: Camera): void;
  /**
   * Returns the first time, from `timeSeconds` on, whose frame is not loaded; Infinity if all are. Absent if the clock
   * never waits.
   */
  loadedUntil?(timeSeconds: number): number;
  /** Time ranges in seconds whose frames are loaded; absent if all frames are. */
  readonly buffered?: readonly (readonly [start: number, end: number])[];
  /** Returns the index in the arrays of the page of a splat on the GPU; absent if they are equal. */
  rowOf?(index: number): number;
  close(): void;
}

/** The generator of a scene. Its Gaussians contain the first frame. */
export interface DynamicModel extends Timeline {
  readonly gaussians: DynamicGaussians;
  readonly bounds: SceneBounds;
}

/** Location of a generator, and the state of its first frame. */
export interface DynamicRequest {
  readonly url: string;
  /** Addresses of models that process the Gaussians in sequence: each receives those of the previous model. */
  readonly chain?: readonly string[];
  /**
   * Contract of the generator as an address, as JSON text, or as an object. Null selects the contract in the model or
   * beside it.
   */
  readonly contract?: unknown;
  readonly credentials: RequestCredentials;
  /** Maximum GPU memory of the Gaussians, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  /**
   * The element that shows the generator. Its attribute `gpu-check` is read only by code that is loaded for generators.
   */
  readonly element: HTMLElement;
  /** Folder of the files of the ONNX runtime; null for the folder beside the bundle. */
  readonly runtimeLocation: string | null;
  /** Provides the worker that reads the header, and a worker that runs the model on the CPU if required. */
  readonly loader: SceneLoader;
  /** Limits for loading the model. */
  readonly limits?: SceneLimits | undefined;
  readonly state: () => DynamicState;
  /** Whether playback restarts at its end. */
  readonly loops: () => boolean;
  /**
   * Whether this model reports unknown controls. False if they may belong to another model, which then reports them.
   */
  readonly ownsControls: () => boolean;
  /**
   * Returns a camera for the first run, which frames the bounds that the contract declares; undefined if it declares
   * none.
   */
  readonly camera: (bounds: SceneBounds | undefined) => Camera;
  readonly listeners: DynamicListeners;
}
