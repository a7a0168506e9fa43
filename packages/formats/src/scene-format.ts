import type { GaussianCloud } from '@gaussian-splat/core';
import type { LoadBudget } from './budget.js';

/** Range of splats in the order of the file: indices from `first` to `end`, excluding `end`. */
export interface SplatRange {
  readonly first: number;
  readonly end: number;
}

/** One scene file in memory, as the input of readers. */
export interface SceneSource {
  /** The whole file, or its beginning if {@link isPrefix} is true. */
  readonly bytes: Uint8Array;
  /** Name in error messages: the file name or URL. */
  readonly name: string;
  /** Account of the load. Readers charge it before any allocation that is larger than the available bytes. */
  readonly budget: LoadBudget;
  /** Signal of the load. Asynchronous and long-running readers call its `throwIfAborted()` between steps. */
  readonly signal?: AbortSignal;
  /** Whether `bytes` is only the beginning of the file. Readers then return complete splats, and skip missing attributes. */
  readonly isPrefix?: boolean;
  /** Range of splats to read; all if absent. Only readers of the files that `splatRanges` describes support it. */
  readonly range?: SplatRange;
  /** Whether an SPZ is embedded in a glTF. Its axes are then those of the specification of SPZ. */
  readonly isWithinGltf?: boolean;
  /** Opens the other files of a scene. Absent if only `bytes` is available. */
  readonly openFile?: OpenFile;
  /** Level of detail to read: 0 is the finest. `all` reads all levels, which `GaussianCloud.levelRuns` locates. */
  readonly level?: number | 'all';
  /** See `ReadSceneOptions.maxSplats`. */
  readonly maxSplats?: number | undefined;
  /** Called with a preview before the whole scene is read. See `ReadSceneOptions.onPreview`. */
  readonly onPreview?: (preview: GaussianCloud) => void | Promise<void>;
}

/** Minimum number of splats of a scene that gets a preview. Smaller scenes are read as fast as a preview. */
const MIN_PREVIEWED = 50_000;

/** Whether a preview was requested and is useful, for a scene of `count` splats. */
export function previewWanted({ onPreview }: SceneSource, count: number): boolean {
  return onPreview !== undefined && count >= MIN_PREVIEWED;
}

/**
 * Opens another file of the same scene.
 *
 * @param path Path of the file, relative to the scene's own file, with `/` between folders. It is not URL-encoded.
 * @param query Query that the scene specifies for the file, with its `?`; absent if there is none.
 * @returns Bytes of the whole file.
 */
export type OpenFile = (path: string, query?: string) => Promise<Uint8Array>;

/**
 * Reads one file format into a cloud. Before a reader allocates memory, it checks the size against the available bytes
 * and charges it to the budget. A reader throws GaussianSplatError `decode/...` or `out-of-memory/budget`. It does not
 * drop unusable splats: `readScene` does.
 */
export type SceneReader = (source: SceneSource) => GaussianCloud | Promise<GaussianCloud>;

export type SceneFormatName =
  | 'ply'
  | 'compressed-ply'
  | 'spz'
  | 'splat'
  | 'ksplat'
  | 'sog'
  | 'lod'
  | 'gltf'
  | 'zip'
  | 'rad'
  | 'lcc'
  | 'lcc2'
  | 'usd';

/** A file format that `readScene` supports. */
export interface SceneFormat {
  readonly name: SceneFormatName;
  /** Name of the format for people, for example `SPZ (Niantic)`. */
  readonly title: string;
  /** File extensions in lower case, with the dot. Several formats may have the same extension. */
  readonly extensions: readonly string[];
  /** Media types that servers send for the format. Most of them are not registered with IANA. */
  readonly mimeTypes: readonly string[];
  /** Returns whether a file has the signature of this format. Absent if the format has no signature. */
  readonly hasSignature?: (bytes: Uint8Array) => boolean;
  /** Whether the reader supports files without their end; see `readPrefix`. */
  readonly readsPrefix?: boolean;
  /**
   * Whether the extension or the media type also select this format, if the signature does not match. The reader then
   * reports the damaged signature.
   */
  readonly isSignatureWeak?: boolean;
  /** Loads the reader by a dynamic import, so that a page downloads only the readers of its formats. */
  readonly load: () => Promise<SceneReader>;
}
