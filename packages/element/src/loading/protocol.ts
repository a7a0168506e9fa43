/** What the page and the scene worker say to each other. */
import type { ErrorData, Vector3 } from '@gaussian-splat/core';
import type { ModelPlace } from '@gaussian-splat/core/onnx';
import type { CpuRunMessage } from '@gaussian-splat/generator';
import type { RendererChoice } from '../attributes.js';
import type { SceneBounds } from '../camera/settings.js';
import type { FloorOptions } from '@gaussian-splat/formats/walk';
import type { ClipPart, LoadLimits, SceneSequence, TriangleFile } from '@gaussian-splat/formats';
import type { PackedGaussians, StreamedScene } from '@gaussian-splat/renderer';
import type {
  CodedFile,
  LevelPage,
  LevelScene,
  PackedHead,
  PackedPortion,
  ShPrecision,
} from '@gaussian-splat/renderer/tools';

/** A scene file, and the body that walks in it. */
export interface FloorRequest extends FileRequest {
  /** Absolute address of a `.voxel.json`, which the floor is found in, in place of the splats. */
  readonly voxelUrl?: string | undefined;
  readonly options: FloorOptions;
}

/** A file to fetch. */
export interface FileRequest {
  /** Absolute URL: a worker's own base URL is not the page's. */
  readonly url: string;
  /** What is there, for a worker that could not fetch it. */
  readonly file?: Blob | undefined;
  /** Fetch's credentials mode, from the `crossorigin` attribute. */
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
  /** What a file of pages that is coded is decoded by. */
  readonly coded?: CodedFile | undefined;
}

/** What loads of a page may cost, and which servers they may ask: see `GaussianSplatElement.sceneLimits`. */
export interface SceneLimits extends LoadLimits {
  /** Origins of other servers that manifests may name files on, such as `https://cdn.example`; they get no cookies. Default: none but the manifest's own. */
  readonly origins?: readonly string[];
}

/** A model whose header is to be read. */
export interface ModelRequest {
  readonly place: ModelPlace;
  readonly limits?: SceneLimits | undefined;
}

/** A scene to fetch. */
export interface SceneRequest extends FileRequest {
  /** Precision of the spherical harmonics on the GPU. */
  readonly sh: ShPrecision | 'auto';
  /** Whether levels of detail are wanted that the file has, besides the finest. */
  readonly levels?: boolean;
  /** What is to draw it; without it, WebGPU. */
  readonly renderer?: RendererChoice;
  /** Whether a streamed SOG scene is loaded whole, in its finest level. */
  readonly isWhole?: boolean;
  /** Bytes of GPU memory that a streamed scene may take where it is not drawn page by page: as much of it is loaded as fits. */
  readonly streamBytes?: number;
  /** The contract of a generator, where the page gives one: an address, JSON text, or the object. */
  readonly contract?: unknown;
  /** Absolute URLs of models that each take the Gaussians of the one before, the first those of `url`. */
  readonly chain?: readonly string[];
}

/** A scene that has been fetched, but for its splats. */
export interface LoadedFacts {
  readonly bounds: SceneBounds;
  /** What of the file is not drawn: see `GaussianCloud.warnings`. */
  readonly warnings?: readonly string[] | undefined;
  /** What splats are ordered by, where the file tells: see `CloudHints.order`. */
  readonly order?: 'pixel' | undefined;
  /** The file has triangles, too. */
  readonly hasMeshes?: boolean | undefined;
}

/** A scene, fetched and packed, ready for upload. */
export interface LoadedScene extends LoadedFacts {
  readonly packed: PackedGaussians;
}

/** A scene whose splats came before it, as {@link ScenePart}s. */
export interface SentScene extends LoadedFacts {
  readonly packed?: undefined;
}

/** Of a scene that is uploaded while its splats are put in order: the head comes first, and again if the load begins again. */
export type ScenePart = { readonly head: PackedHead } | { readonly portion: PackedPortion };

/** Called with each part. The last one holds the bounds of all chunks. */
export type PartListener = (part: ScenePart) => void;

/** The triangles of a file, checked, with its images decoded. */
export interface LoadedMesh extends Omit<TriangleFile, 'images'> {
  /** Each image that is used. */
  readonly images: readonly (ImageBitmap | undefined)[];
}

/** The manifest of scenes that follow one another in time, in place of a scene. Its paths are relative to its own address. */
export type LoadedSequence = SceneSequence;

/** A frame of a sequence whose splats are those of the first: all that the worker must know, for it may have been ended meanwhile. */
export interface MovedFrameRequest {
  readonly first: FileRequest;
  /** The file with what this frame differs by, its number there, and the frames of the file; absent for the first frame. */
  readonly motion?: (FileRequest & { readonly frame: number; readonly frames: number }) | undefined;
  readonly sh: SceneRequest['sh'];
  readonly limits?: SceneLimits | undefined;
}

/** The index of a clip, or a part of one of its groups: asked for as `boxes`, since both come by byte ranges. */
export interface ClipRequest extends FileRequest {
  readonly isClip: true;
  /** The whole file, where the page has it. */
  readonly whole?: Blob | undefined;
  /** Absent for the index. */
  readonly part?: { readonly part: ClipPart; readonly frames: number; readonly origin: Vector3 };
}

/** What comes of a {@link ClipRequest}. */
export interface ClipAnswer<T> {
  readonly clip: T;
  /** Its buffers change threads. */
  readonly levels: object;
}

/** A streamed SOG scene of which the coarsest levels are there. */
export interface LoadedBoxes {
  readonly levels: LevelScene;
  /** Paths of the SOG files, relative to the index. */
  readonly files: readonly string[];
  /** The levels of all boxes, those of a box the coarsest first: number of the file, first splat, and count of each. */
  readonly runs: Float64Array;
  /** Number of the first run of each box. */
  readonly firstRuns: Uint32Array;
}

/** A level of a box of such a scene: all that the worker must know, for it may have been ended meanwhile. */
export interface BoxRequest {
  /** Absolute address of the index. */
  readonly url: string;
  /** Path of the SOG file, relative to the index. */
  readonly path: string;
  /** First splat there. */
  readonly first: number;
  readonly count: number;
  readonly page: LevelPage;
  readonly scene: StreamedScene;
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
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

/** What a worker may be asked for; every request gets a number, and one `answer` or `error`. */
export type WorkerRequest =
  | {
      readonly type: 'load';
      readonly request: SceneRequest;
      readonly wantsPreviews: boolean;
      readonly wantsParts: boolean;
    }
  | { readonly type: 'levels'; readonly packed: PackedGaussians }
  | { readonly type: 'file'; readonly request: FileRequest }
  | { readonly type: 'manifest'; readonly request: FileRequest }
  | { readonly type: 'mesh'; readonly request: FileRequest }
  | { readonly type: 'boxes'; readonly request: SceneRequest | ClipRequest }
  | { readonly type: 'box'; readonly request: BoxRequest }
  | { readonly type: 'frame'; readonly request: MovedFrameRequest }
  | { readonly type: 'floor'; readonly request: FloorRequest }
  | { readonly type: 'model'; readonly request: ModelRequest };

export type PageMessage =
  | (WorkerRequest & { readonly id: number })
  | { readonly type: 'cancel'; readonly id: number }
  /** Is answered by `pong`. */
  | { readonly type: 'ping' }
  /** A way to another worker that packs splats. */
  | { readonly type: 'helper'; readonly id: number; readonly port: MessagePort }
  /** Pack what comes through the port. */
  | { readonly type: 'pack'; readonly port: MessagePort }
  /** Sort splats, at these positions, for the views that come through the port. */
  | {
      readonly type: 'sort';
      readonly port: MessagePort;
      readonly positions: Float32Array;
      readonly areas?: Float32Array | undefined;
    }
  /** Run a generator once on the CPU, in a worker that is started for it. */
  | CpuRunMessage;

export type WorkerMessage =
  /** The script runs. */
  | { readonly type: 'ready' }
  | { readonly type: 'pong' }
  /** From now on it reads for a request, and may not answer for long. */
  | { readonly type: 'reading'; readonly id: number }
  /** It has read for a request, or nothing is done for it any more. */
  | { readonly type: 'rested'; readonly id: number }
  /** Other workers could share the packing for a request: so many at most. */
  | { readonly type: 'help'; readonly id: number; readonly most: number }
  | { readonly type: 'progress'; readonly id: number; readonly loaded: number; readonly total: number | undefined }
  | { readonly type: 'preview'; readonly id: number; readonly scene: LoadedScene }
  | { readonly type: 'part'; readonly id: number; readonly part: ScenePart }
  | { readonly type: 'answer'; readonly id: number; readonly answer: unknown }
  | { readonly type: 'error'; readonly id: number; readonly error: ErrorData };

/** Every buffer of some plain objects once: transferred, data of any size changes threads at no cost. */
export function buffersOf(...parts: readonly object[]): ArrayBuffer[] {
  const buffers = parts
    .flatMap((part) => Object.values(part))
    .filter((value): value is ArrayBufferView<ArrayBuffer> => ArrayBuffer.isView(value))
    .map((view) => view.buffer);
  return [...new Set(buffers)];
}
