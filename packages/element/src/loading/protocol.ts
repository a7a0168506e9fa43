/** What the page and the scene worker say to each other. */
import type { ErrorData } from '@gaussian-splat/core';
import type { SceneBounds } from '../camera/settings.js';
import type { SogRun } from '@gaussian-splat/formats';
import type {
  LevelPage,
  LevelScene,
  PackedGaussians,
  PackedLevels,
  ShPrecision,
  StreamedScene,
} from '@gaussian-splat/renderer';

/** A file to fetch. */
export interface FileRequest {
  /** Absolute URL: a worker's own base URL is not the page's. */
  readonly url: string;
  /** Fetch's credentials mode, from the `crossorigin` attribute. */
  readonly credentials: RequestCredentials;
}

/** A scene to fetch. */
export interface SceneRequest extends FileRequest {
  /** Precision of the spherical harmonics on the GPU. */
  readonly sh: ShPrecision | 'auto';
  /** Whether levels of detail are wanted that the file has, besides the finest. */
  readonly levels?: boolean;
  /** The contract of a generator, where the page gives one: an address, JSON text, or the object. */
  readonly contract?: unknown;
  /** Absolute URLs of models that each take the Gaussians of the one before, the first those of `url`. */
  readonly chain?: readonly string[];
}

/** A scene, fetched and packed, ready for upload. */
export interface LoadedScene {
  readonly packed: PackedGaussians;
  readonly bounds: SceneBounds;
}

/** The manifest of scenes that follow one another in time, in place of a scene. */
export interface LoadedSequence {
  /** Absolute URLs of the frames, in order. */
  readonly frames: readonly string[];
  readonly framesPerSecond: number;
  readonly durationSeconds: number;
}

/** A streamed SOG scene of which the coarsest levels are there. */
export interface LoadedBoxes {
  readonly levels: LevelScene;
  /** Where the levels of each box lie, the coarsest first. */
  readonly runs: readonly (readonly SogRun[])[];
}

/** A level of a box of such a scene: all that the worker must know, for it may have been ended meanwhile. */
export interface BoxRequest {
  readonly run: SogRun;
  readonly page: LevelPage;
  readonly scene: StreamedScene;
  readonly credentials: RequestCredentials;
}

/**
 * Called with a part of a scene that is still loading, ready for upload: fewer splats, or splats without their view-dependent colours.
 * Each preview replaces the one before.
 */
export type PreviewListener = (preview: LoadedScene) => void;

/**
 * Hears how many bytes have arrived, and of how many; undefined while that is not known.
 * @param share of all that there is to do, 0..1; absent where that is the bytes alone.
 */
export type ProgressListener = (loaded: number, total: number | undefined, share?: number) => void;

export type PageMessage =
  | { readonly type: 'load'; readonly id: number; readonly request: SceneRequest; readonly wantsPreviews: boolean }
  | { readonly type: 'levels'; readonly id: number; readonly packed: PackedGaussians }
  | { readonly type: 'file'; readonly id: number; readonly request: FileRequest }
  | { readonly type: 'boxes'; readonly id: number; readonly request: SceneRequest }
  | { readonly type: 'box'; readonly id: number; readonly request: BoxRequest }
  | { readonly type: 'cancel'; readonly id: number };

export type WorkerMessage =
  | { readonly type: 'ready' }
  | { readonly type: 'progress'; readonly id: number; readonly loaded: number; readonly total: number | undefined }
  | { readonly type: 'preview'; readonly id: number; readonly scene: LoadedScene }
  | { readonly type: 'sequence'; readonly id: number; readonly sequence: LoadedSequence }
  | { readonly type: 'scene'; readonly id: number; readonly scene: LoadedScene }
  | { readonly type: 'levels'; readonly id: number; readonly levels: PackedLevels | undefined }
  | { readonly type: 'file'; readonly id: number; readonly bytes: ArrayBuffer }
  | { readonly type: 'boxes'; readonly id: number; readonly boxes: LoadedBoxes }
  | { readonly type: 'error'; readonly id: number; readonly error: ErrorData };
