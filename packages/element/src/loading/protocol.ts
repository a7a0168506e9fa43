/** Messages between the page and the scene worker. */
import type { ErrorData, ShDegree, TrainedOrder, Vector3 } from '@gaussian-splat/core';
import type { ModelPlace } from '@gaussian-splat/core/onnx';
import type { CpuCheckMessage } from '@gaussian-splat/generator';
import type { RendererChoice } from '../viewer/attributes.js';
import type { SceneBounds } from '../viewer/camera/settings.js';
import type { FloorOptions } from '@gaussian-splat/formats/floor';
import type { ClipPart, LoadLimits, SceneSequence, TriangleFile } from '@gaussian-splat/formats';
import type { PackedGaussians, StreamedScene } from '@gaussian-splat/renderer';
import type {
  BlockBuffers,
  CodedFile,
  LevelPage,
  LevelScene,
  PackedHead,
  PackedPortion,
  ShPrecision,
} from '@gaussian-splat/renderer/tools';

/** A scene file whose floor is to be found, and the dimensions of the walker. */
export interface FloorRequest extends FileRequest {
  /** Absolute address of a `.voxel.json`, which replaces the splats as the source of the floor. */
  readonly voxelUrl?: string | undefined;
  /** Bytes of a `.floor` file, which is decoded instead. */
  readonly map?: ArrayBuffer | undefined;
  readonly options: FloorOptions;
}

/** A file to fetch. */
export interface FileRequest {
  /** Absolute URL, because a worker's own base URL differs from the page's. */
  readonly url: string;
  /** Content of the file, for a worker that cannot fetch the URL. */
  readonly file?: Blob | undefined;
  /** Fetch's credentials mode, from the `crossorigin` attribute. */
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
  /** Parameters for decoding a coded file of pages; absent for other files. */
  readonly coded?: CodedFile | undefined;
}

/** Limits of the loads of a page, and the servers that they may use: see `GaussianSplatElement.sceneLimits`. */
export interface SceneLimits extends LoadLimits {
  /**
   * Origins of other servers that manifests may refer to, such as `https://cdn.example`. Requests to them carry no
   * cookies. Default: none, so that manifests may refer only to their own server.
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
  /** Precision of the spherical harmonics on the GPU; `auto` chooses it by the size of the scene. */
  readonly sh: ShPrecision | 'auto';
  /** Whether all levels of detail in the file are loaded; otherwise only the finest. */
  readonly levels?: boolean;
  /** Renderer of the scene; default: WebGPU. */
  readonly renderer?: RendererChoice;
  /** Whether a streamed SOG scene is loaded completely, in its finest level. */
  readonly isWhole?: boolean;
  /**
   * GPU memory limit, in bytes, of a streamed scene that is drawn without pages. The load takes the finest part that
   * fits.
   */
  readonly streamBytes?: number;
  /** The contract of a generator, if the page provides one, as an address, as JSON text, or as an object. */
  readonly contract?: unknown;
  /**
   * Absolute URLs of models that process Gaussians in sequence. Each receives the Gaussians of the previous model; the
   * first receives those of `url`.
   */
  readonly chain?: readonly string[];
}

/** Properties of a fetched scene, without its splats. */
export interface LoadedFacts {
  readonly bounds: SceneBounds;
  /** Messages about content that is not drawn: see `GaussianCloud.warnings`. */
  readonly warnings?: readonly string[] | undefined;
  /** Sort order of splats, if the file declares one: see `CloudHints.order`. */
  readonly order?: TrainedOrder | undefined;
  /** Whether the file also contains triangle meshes. */
  readonly hasMeshes?: boolean | undefined;
}

/** A scene, fetched and packed, ready for upload. */
export interface LoadedScene extends LoadedFacts {
  readonly packed: PackedGaussians;
}

/** Properties of a scene whose splats have been sent before, as {@link ScenePart}s. */
export interface SentScene extends LoadedFacts {
  readonly packed?: undefined;
}

/**
 * Part of a scene that is uploaded while its splats are sorted. The head is sent first. If the load restarts, another
 * head is sent, and the earlier parts are void.
 */
export type ScenePart = { readonly head: PackedHead } | { readonly portion: PackedPortion };

/**
 * Called with each part of a scene. The last part contains the bounds of all chunks. Resolves when the part is used, with
 * the buffers of its splats, which the worker uses again.
 */
export type PartListener = (part: ScenePart) => void | Promise<BlockBuffers | undefined>;

/** The validated triangles of a file, and its decoded images. */
export interface LoadedMesh extends Omit<TriangleFile, 'images'> {
  /** Images of the file, by their index; undefined for unused ones. */
  readonly images: readonly (ImageBitmap | undefined)[];
}

/** The manifest of a sequence of scenes. Its paths are relative to its own address. */
export type LoadedSequence = SceneSequence;

/**
 * A request for the index of a clip, or for a part of one of its groups. It is sent as type `boxes`, whose code also
 * reads by byte ranges.
 */
export interface ClipRequest extends FileRequest {
  readonly isClip: true;
  /** Content of the whole file, if the page already has it. */
  readonly whole?: Blob | undefined;
  /** Validator of the version of the file that the index is from: see `FetchedRange.tag`. */
  readonly tag?: string | undefined;
  /** The requested part; absent to request the index. */
  readonly part?: {
    readonly part: ClipPart;
    /** Index of the group that the part belongs to. */
    readonly group: number;
    readonly frames: number;
    readonly shDegree: ShDegree;
    readonly origin: Vector3;
  };
}

/** Answer to a {@link ClipRequest}. */
export interface ClipAnswer<T> {
  readonly clip: T;
  /** Object whose buffers are transferred: the clip itself. */
  readonly levels: object;
}

/** A streamed SOG scene with its coarsest levels. */
export interface LoadedBoxes {
  readonly levels: LevelScene;
  /** Paths of the SOG files, relative to the index. */
  readonly files: readonly string[];
  /**
   * [R, 3] levels of all boxes, coarsest first within a box: index of the file, index of the first splat, and number of
   * splats.
   */
  readonly runs: Float64Array;
  /** [B] index in `runs` of the first level of each box. */
  readonly firstRuns: Uint32Array;
}

/**
 * A request for a level of a box of a streamed SOG scene. It contains all data that the worker needs, because the
 * worker may have been restarted since the previous request.
 */
export interface BoxRequest {
  /** Absolute address of the index. */
  readonly url: string;
  /** Path of the SOG file, relative to the index. */
  readonly path: string;
  /** Index of the level's first splat in the file. */
  readonly first: number;
  readonly count: number;
  readonly page: LevelPage;
  readonly scene: StreamedScene;
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
}

/**
 * Called with a part of a scene that is still loading, ready for upload. It has fewer splats, or no view-dependent
 * colors. Each preview replaces the previous one.
 */
export type PreviewListener = (preview: LoadedScene) => void;

/**
 * Called with the received and the total bytes; the total is undefined if it is unknown.
 * @param share Completed fraction of all work of the load, 0..1; absent if the bytes determine it.
 */
export type ProgressListener = (loaded: number, total: number | undefined, share?: number) => void;

/**
 * Requests to a worker. Each is sent with an `id`, and results in one `answer` or one `error`, unless it is canceled.
 */
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
  | { readonly type: 'floor'; readonly request: FloorRequest }
  | { readonly type: 'model'; readonly request: ModelRequest };

export type PageMessage =
  | (WorkerRequest & { readonly id: number })
  | { readonly type: 'cancel'; readonly id: number }
  /** Requests a `pong`, which shows that the worker responds. */
  | { readonly type: 'ping' }
  /** The next part of a scene was used. `buffers`: those of its splats, which are transferred back. */
  | { readonly type: 'taken'; readonly id: number; readonly buffers: BlockBuffers | undefined }
  /** Provides a request with a port to another worker that packs splats. */
  | { readonly type: 'helper'; readonly id: number; readonly port: MessagePort }
  /** Makes the worker a helper, which runs the tasks from the port. */
  | { readonly type: 'pack'; readonly port: MessagePort }
  /** Makes the worker sort splats for the views that arrive on the port. `positions`: [N, 3]; `areas`: [N]. */
  | {
      readonly type: 'sort';
      readonly port: MessagePort;
      readonly positions: Float32Array;
      readonly areas?: Float32Array | undefined;
    }
  /** Makes the worker, which is started for this purpose, run a generator once on the CPU. */
  | CpuCheckMessage;

export type WorkerMessage =
  /** The worker's script has started. */
  | { readonly type: 'ready' }
  | { readonly type: 'pong' }
  /** The worker starts reading for a request, and may not answer messages for a long time. */
  | { readonly type: 'reading'; readonly id: number }
  /** The worker has finished reading for a request, or the request was canceled. */
  | { readonly type: 'rested'; readonly id: number }
  /** Other workers can help to pack the scene of a request; `max` is their maximum number. */
  | { readonly type: 'help'; readonly id: number; readonly max: number }
  | { readonly type: 'progress'; readonly id: number; readonly loaded: number; readonly total: number | undefined }
  | { readonly type: 'preview'; readonly id: number; readonly scene: LoadedScene }
  | { readonly type: 'part'; readonly id: number; readonly part: ScenePart }
  | { readonly type: 'answer'; readonly id: number; readonly answer: unknown }
  | { readonly type: 'error'; readonly id: number; readonly error: ErrorData };

/**
 * Returns the buffers of all typed arrays in some plain objects, each once, for transferring them between threads
 * without copies.
 */
export function buffersOf(...parts: readonly object[]): ArrayBuffer[] {
  const buffers = parts
    .flatMap((part) => Object.values(part))
    .filter((value): value is ArrayBufferView<ArrayBuffer> => ArrayBuffer.isView(value))
    .map((view) => view.buffer);
  return [...new Set(buffers)];
}
