/** Requests to the scene worker, its answers, and the functions that it calls meanwhile. Those of one task alone are beside its code. */
import type { Credits, TrainedOrder } from '@gaussian-splat/core';
import type { RendererChoice } from '../viewer/attributes.js';
import type { SceneBounds } from '../viewer/camera/settings.js';
import type { LoadLimits, SceneSequence } from '@gaussian-splat/formats';
import type { PackedGaussians } from '@gaussian-splat/renderer';
import type { BlockBuffers, CodedFile, PackedHead, PackedPortion, ShPrecision } from '@gaussian-splat/renderer/tools';

/** A file to fetch. */
export interface FileRequest {
  /** Absolute URL, because a worker's own base URL differs from the page's. */
  readonly url: string;
  /** Content of the file, for a worker that cannot fetch the URL. */
  readonly file?: Blob | undefined;
  /** Fetch's credentials mode, from the `crossorigin` attribute. */
  readonly credentials: RequestCredentials;
  readonly limits?: SceneLimits | undefined;
  /**
   * Number of the element or child that requests the file, whose requests share worker time. Those without a number share
   * that of their address.
   */
  readonly source?: number | undefined;
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

/** A scene to fetch. */
export interface SceneRequest extends FileRequest {
  /** Precision of the spherical harmonics on the GPU; `auto` chooses it by the size of the scene. */
  readonly sh: ShPrecision | 'auto';
  /** Whether all levels of detail in the file are loaded; otherwise only the finest. */
  readonly levels?: boolean;
  /** Whether the file is shown as triangle meshes, without splats. */
  readonly isMesh?: boolean | undefined;
  /** Content of the file, if another worker has downloaded it. Other files are still found beside `url`. */
  readonly downloaded?: Blob | undefined;
  /** Renderer of the scene; default: WebGPU. */
  readonly renderer?: RendererChoice;
  /** Whether nodes of a tree are packed in float32, as WebGL draws them; default: quantized. */
  readonly isExact?: boolean | undefined;
  /** Whether a streamed SOG scene is loaded completely, in its finest level. */
  readonly isWhole?: boolean;
  /**
   * GPU memory limit, in bytes, of a streamed scene that is drawn without pages. The load takes the finest part that
   * fits.
   */
  readonly streamBytes?: number;
  /** Property of a PLY with the group of each splat, or empty for the first known one; undefined without groups. */
  readonly groups?: string | undefined;
  /** The property `splats` of the element; absent for a source with an address. */
  readonly splats?: unknown;
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
  readonly credits?: Credits | undefined;
  readonly groups?: SceneGroups | undefined;
}

/** The groups of a scene's splats, such as the objects that a segmentation has found. */
export interface SceneGroups {
  /** [G] numbers of the groups in the file, ascending. */
  readonly ids: Int32Array;
  /** [G] number of splats of each group. */
  readonly counts: Uint32Array;
  /** [G, 6] lower and upper corner of the box of the centers of each group, in the coordinates of the file. */
  readonly boxes: Float64Array;
  /** [N] index of the group of each splat, in the order of the packed scene. */
  readonly of: Uint16Array;
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
export type PartListener = (part: ScenePart) => void | ReturnType<PartTaker>;
/** A listener that uses each part. */
export type PartTaker = (part: ScenePart) => Promise<BlockBuffers | undefined>;

/** The manifest of a sequence of scenes. Its paths are relative to its own address. */
export type LoadedSequence = SceneSequence;

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

/** Thrown by a task that another worker continues. It is no error, and is not reported. */
export const HANDED_ON = Symbol('handed on');

/** Functions that a task of the worker calls. Only loads of scenes call more than `onProgress`. */
export interface TaskListeners {
  readonly onProgress: ProgressListener;
  /** Receives previews of the scene; absent if none are wanted. */
  readonly onPreview?: PreviewListener | undefined;
  /** Receives the splats of a large scene while they are sorted. If it is absent, the splats are part of the result. */
  readonly onPart?: PartListener | undefined;
  /**
   * Called with true before the thread becomes busy and does not respond, perhaps repeatedly. Called with false when it
   * responds again.
   */
  readonly onReading?: (isReading: boolean) => void;
  /**
   * Offers a downloaded file to another worker. Returns whether that worker reads it; then the task must end with
   * {@link HANDED_ON}.
   */
  readonly handOn?: (bytes: Uint8Array) => boolean;
  /**
   * Requests other workers for packing.
   * @param max Maximum number of workers.
   * @param onHelper Called with a port to each worker when that worker is available.
   */
  readonly askForHelp?: (max: number, onHelper: (port: MessagePort) => void) => void;
}

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
