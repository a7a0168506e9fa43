/** Messages between the page and the scene worker. */
import type { ErrorData, Vector3 } from '@gaussian-splat/core';
import type { ModelPlace } from '@gaussian-splat/core/onnx';
import type { CpuCheckMessage } from '@gaussian-splat/generator';
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

/** A scene file, and the dimensions of a walker. */
export interface FloorRequest extends FileRequest {
  /** Absolute address of a `.voxel.json`, the source of the floor instead of the splats. */
  readonly voxelUrl?: string | undefined;
  readonly options: FloorOptions;
}

/** A file to fetch. */
export interface FileRequest {
  /** Absolute URL, because a worker's own base URL differs from the page's. */
  readonly url: string;
  /** Its content, for a worker that could not fetch it. */
  readonly file?: Blob | undefined;
  /** Fetch's credentials mode, from the `crossorigin` attribute. */
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
  /** Parameters for decoding a coded file of pages. */
  readonly coded?: CodedFile | undefined;
}

/** Limits of a page's loads, and allowed servers: see `GaussianSplatElement.sceneLimits`. */
export interface SceneLimits extends LoadLimits {
  /**
   * Origins of other servers that manifests may refer to, such as `https://cdn.example`; they get no cookies. Default:
   * only the manifest's own.
   */
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
  /** Whether the file's own levels of detail are needed, besides the finest. */
  readonly levels?: boolean;
  /** Its backend; default WebGPU. */
  readonly renderer?: RendererChoice;
  /** Whether a streamed SOG scene is loaded completely, in its finest level. */
  readonly isWhole?: boolean;
  /** GPU memory limit in bytes of a streamed scene that is drawn without pages: as much of it is loaded as fits. */
  readonly streamBytes?: number;
  /** The contract of a generator, if the page provides one: an address, JSON text, or the object. */
  readonly contract?: unknown;
  /** Absolute URLs of models that each receive the Gaussians of the previous one, the first those of `url`. */
  readonly chain?: readonly string[];
}

/** A fetched scene without its splats. */
export interface LoadedFacts {
  readonly bounds: SceneBounds;
  /** Messages about content that is not drawn: see `GaussianCloud.warnings`. */
  readonly warnings?: readonly string[] | undefined;
  /** Sort order of splats, if the file declares one: see `CloudHints.order`. */
  readonly order?: 'pixel' | undefined;
  /** Whether the file has triangles, too. */
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

/** Part of a scene that is uploaded while its splats are sorted: the head comes first, and again if the load restarts. */
export type ScenePart = { readonly head: PackedHead } | { readonly portion: PackedPortion };

/** Called with each part. The last one holds the bounds of all chunks. */
export type PartListener = (part: ScenePart) => void;

/** The triangles of a file, validated, with its images decoded. */
export interface LoadedMesh extends Omit<TriangleFile, 'images'> {
  /** Each used image. */
  readonly images: readonly (ImageBitmap | undefined)[];
}

/** The manifest of a sequence of scenes, instead of a scene. Its paths are relative to its own address. */
export type LoadedSequence = SceneSequence;

/**
 * A frame of a sequence with the splats of the first: all data that the worker needs, because it may have been
 * restarted meanwhile.
 */
export interface MovedFrameRequest {
  readonly first: FileRequest;
  /**
   * The file with the differences of this frame, its index there, and the frames of the file; absent for the first
   * frame.
   */
  readonly motion?: (FileRequest & { readonly frame: number; readonly frames: number }) | undefined;
  readonly sh: SceneRequest['sh'];
  readonly limits?: SceneLimits | undefined;
}

/** The index of a clip, or a part of one of its groups: requested as `boxes`, because both use byte ranges. */
export interface ClipRequest extends FileRequest {
  readonly isClip: true;
  /** The whole file, if the page has it. */
  readonly whole?: Blob | undefined;
  /** Absent for the index. */
  readonly part?: {
    readonly part: ClipPart;
    /** Number of its group. */
    readonly group: number;
    readonly frames: number;
    readonly origin: Vector3;
  };
}

/** Result of a {@link ClipRequest}. */
export interface ClipAnswer<T> {
  readonly clip: T;
  /** Its buffers are transferred. */
  readonly levels: object;
}

/** A streamed SOG scene with its coarsest levels. */
export interface LoadedBoxes {
  readonly levels: LevelScene;
  /** Paths of the SOG files, relative to the index. */
  readonly files: readonly string[];
  /** The levels of all boxes, coarsest first within a box: index of the file, first splat, and count of each. */
  readonly runs: Float64Array;
  /** Index of the first run of each box. */
  readonly firstRuns: Uint32Array;
}

/** A level of a box of such a scene: all data that the worker needs, because it may have been restarted meanwhile. */
export interface BoxRequest {
  /** Absolute address of the index. */
  readonly url: string;
  /** Path of the SOG file, relative to the index. */
  readonly path: string;
  /** Index of its first splat in the file. */
  readonly first: number;
  readonly count: number;
  readonly page: LevelPage;
  readonly scene: StreamedScene;
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
}

/**
 * Called with a part of a scene that is still loading, ready for upload: fewer splats, or splats without their
 * view-dependent colors. Each preview replaces the previous one.
 */
export type PreviewListener = (preview: LoadedScene) => void;

/**
 * Called with the received and total bytes; the total is undefined if unknown.
 * @param share Fraction of the whole work, 0..1; absent if the bytes determine it.
 */
export type ProgressListener = (loaded: number, total: number | undefined, share?: number) => void;

/** Requests to a worker; every request has a number, and one `answer` or `error`. */
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
  /** Answered by `pong`. */
  | { readonly type: 'ping' }
  /** A port to another worker that packs splats. */
  | { readonly type: 'helper'; readonly id: number; readonly port: MessagePort }
  /** Packs the data from the port. */
  | { readonly type: 'pack'; readonly port: MessagePort }
  /** Sorts splats at these positions for the views from the port. */
  | {
      readonly type: 'sort';
      readonly port: MessagePort;
      readonly positions: Float32Array;
      readonly areas?: Float32Array | undefined;
    }
  /** Runs a generator once on the CPU, in a worker that is started for it. */
  | CpuCheckMessage;

export type WorkerMessage =
  /** The script has started. */
  | { readonly type: 'ready' }
  | { readonly type: 'pong' }
  /** It starts reading for a request, and may not answer for long. */
  | { readonly type: 'reading'; readonly id: number }
  /** It has finished reading for a request, or the request was canceled. */
  | { readonly type: 'rested'; readonly id: number }
  /** Other workers could share the packing for a request: at most this many. */
  | { readonly type: 'help'; readonly id: number; readonly max: number }
  | { readonly type: 'progress'; readonly id: number; readonly loaded: number; readonly total: number | undefined }
  | { readonly type: 'preview'; readonly id: number; readonly scene: LoadedScene }
  | { readonly type: 'part'; readonly id: number; readonly part: ScenePart }
  | { readonly type: 'answer'; readonly id: number; readonly answer: unknown }
  | { readonly type: 'error'; readonly id: number; readonly error: ErrorData };

/** All buffers of some plain objects, each once: they are transferred between threads without copies. */
export function buffersOf(...parts: readonly object[]): ArrayBuffer[] {
  const buffers = parts
    .flatMap((part) => Object.values(part))
    .filter((value): value is ArrayBufferView<ArrayBuffer> => ArrayBuffer.isView(value))
    .map((view) => view.buffer);
  return [...new Set(buffers)];
}
