import type { GaussianCloud } from '@gaussian-splat/core';
import type { LoadBudget } from './budget.js';

/** Splats `first` to `end`, excluding the latter, in the order of the file. */
export interface SplatRange {
  readonly first: number;
  readonly end: number;
}

/** One scene file in memory, as the input of readers. */
export interface SceneSource {
  /** The whole file, as downloaded or read. */
  readonly bytes: Uint8Array;
  /** Name in error messages: the file name or URL. */
  readonly name: string;
  /** Account of the load: charged before any allocation that is larger than the available bytes. */
  readonly budget: LoadBudget;
  /** Asynchronous or long-running readers call `throwIfAborted()` between steps. */
  readonly signal?: AbortSignal;
  /** Whether `bytes` are only the beginning of the file: complete splats are read, missing attributes skipped. */
  readonly isPrefix?: boolean;
  /** Range of splats to read; ignored by readers without support for ranges. See `splatRanges`. */
  readonly range?: SplatRange;
  /** Whether the SPZ is embedded in a glTF: its coordinates are then those of SPZ's specification. */
  readonly isWithinGltf?: boolean;
  /** Opens the other files of a scene of several files; absent for a single file. */
  readonly openFile?: OpenFile;
  /** Level of detail to read: 0 is the finest. `all`: all of them, in the runs of `GaussianCloud.levelRuns`. */
  readonly level?: number | 'all';
  /** See `ReadSceneOptions.maxSplats`. */
  readonly maxSplats?: number | undefined;
  /** Called with a preview before the whole scene is read. See `ReadSceneOptions.onPreview`. */
  readonly onPreview?: (preview: GaussianCloud) => void | Promise<void>;
}

/** Smaller scenes are read as fast as a preview. */
const MIN_PREVIEWED = 50_000;

/** Whether a preview was requested, and a scene of `count` splats is large enough for one. */
export function previewWanted({ onPreview }: SceneSource, count: number): boolean {
  return onPreview !== undefined && count >= MIN_PREVIEWED;
}

/**
 * Opens another file of the same scene.
 *
 * @param path As in the scene: relative to the scene's own file, `/` between folders, not URL-encoded.
 * @param query Query that the scene appends for the server, from its `?` on; absent for none.
 * @returns The whole file.
 */
export type OpenFile = (path: string, query?: string) => Promise<Uint8Array>;

/**
 * Reads one file format into a cloud. A reader checks every size against the available bytes and charges it to the
 * load's budget before it allocates, throws `GaussianSplatError` with a code of the `decode` family (or
 * `out-of-memory/budget`), and lets `readScene` drop unusable splats.
 */
export type SceneReader = (source: SceneSource) => GaussianCloud | Promise<GaussianCloud>;

export type SceneFormatName =
  'ply' | 'compressed-ply' | 'spz' | 'splat' | 'ksplat' | 'sog' | 'lod' | 'gltf' | 'zip' | 'rad';

/** A file format of `readScene`: its names, its signature, and its reader. */
export interface SceneFormat {
  readonly name: SceneFormatName;
  /** Display name. */
  readonly title: string;
  /** File extensions in lower case, with the dot. A format may share an extension with another. */
  readonly extensions: readonly string[];
  /** Media types seen in use; none of them is registered with IANA. */
  readonly mimeTypes: readonly string[];
  /** Whether the first bytes of the file prove this format. Absent if the format has no signature. */
  readonly hasSignature?: (bytes: Uint8Array) => boolean;
  /** Whether the reader supports a file without its end: see `readPrefix`. */
  readonly readsPrefix?: boolean;
  /** Whether the signature may be damaged while the name is right, so that the reader can report the fault. */
  readonly isSignatureWeak?: boolean;
  /** Loads the reader; a dynamic import, so that a page fetches only the readers it needs. */
  readonly load: () => Promise<SceneReader>;
}
