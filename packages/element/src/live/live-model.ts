import type { Camera } from '@gaussian-splat/core';
import type { DynamicGaussians } from '@gaussian-splat/renderer';
import type { SceneBounds } from '../camera/settings.js';
import type { GeneratorInput } from './inputs.js';
import type { SceneLimits } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { ReadControls } from './values.js';

/** What a page says about a model, apart from the camera. Small and capital letters of names are the same. */
export interface LiveState extends ReadControls {
  readonly timeSeconds: number;
  /** Flattened; undefined for the model's rest pose. */
  readonly pose: readonly number[] | undefined;
}

/** Whom a model tells. */
export interface LiveListeners {
  /** A frame for a time is ready to be drawn. */
  readonly onFrame: (timeSeconds: number) => void;
  /** The frame of a time is on show, as of the picture that is being drawn. */
  readonly onShown: (timeSeconds: number) => void;
  /** A run failed; the last good frame stays. */
  readonly onError: (error: unknown) => void;
  /** The model runs on the CPU. */
  readonly onFallback: (reason: string) => void;
  /** Something that the next run takes has arrived: a picture. */
  readonly onInput: () => void;
}

/** What changes the Gaussians of a scene as time goes on: a generator, or a sequence of files. */
export interface Timeline {
  /** Bounds of the Gaussians as they are now; absent where those of the first frame count. */
  readBounds?(): Promise<SceneBounds>;
  /** Where the Gaussians are: as the contract declares, or as of the last runs. */
  readonly bounds?: SceneBounds;
  /** Seconds; Infinity where the contract declares none. */
  readonly duration: number;
  /** What the page may set; absent where there is nothing. */
  readonly inputs?: readonly GeneratorInput[];
  /** Inputs that `control-NAME` sets; absent where there are none. */
  readonly settable?: readonly string[];
  /** Asks for the Gaussians of a state; the latest request wins, and an unchanged one costs nothing. */
  request(state: LiveState, camera: Camera): void;
  /** Where nothing can be shown yet that the time asks for, the clock waits; absent where it never does. */
  isLacking?(timeSeconds: number): boolean;
  /** [start, end] of the times that need no more bytes, seconds; absent for all. */
  readonly buffered?: readonly (readonly [start: number, end: number])[];
  close(): void;
}

/** A generator behind a scene, with the first frame in its Gaussians. */
export interface LiveModel extends Timeline {
  readonly gaussians: DynamicGaussians;
  readonly bounds: SceneBounds;
}

/** Where the generator is, and what its first frame shows. */
export interface LiveRequest {
  readonly url: string;
  /** Addresses of models that each take the Gaussians of the one before. */
  readonly chain?: readonly string[];
  /** Address of a contract, its JSON text, or the contract itself; null for that of the model or beside it. */
  readonly contract?: unknown;
  readonly credentials: RequestCredentials;
  /** Bytes of GPU memory that the Gaussians may take; undefined for no limit but the device's. */
  readonly memoryBudget: number | undefined;
  /** The element that shows it: only code that is loaded for generators reads its attribute `compare`. */
  readonly element: HTMLElement;
  /** Folder of the runtime's files; null for the one beside the bundle. */
  readonly runtimeLocation: string | null;
  /** Has workers: one that reads the header, and one that runs a model on the CPU when asked. */
  readonly loader: SceneLoader;
  /** What the model may cost. */
  readonly limits?: SceneLimits | undefined;
  readonly state: () => LiveState;
  /** Whether the time begins again at its end. */
  readonly loops: () => boolean;
  /** False where controls may be another model's, which then reports what neither knows. */
  readonly ownsControls: () => boolean;
  /** A camera before anything is known of the scene but, perhaps, the bounds that the contract declares. */
  readonly camera: (bounds: SceneBounds | undefined) => Camera;
  readonly listeners: LiveListeners;
}
