import type { GaussianCloud } from '@gaussian-splat/core';
import type { LoadBudget } from './budget.js';

/** Splats `first` to `end`, the latter not included, in the order of the file. */
export interface SplatRange {
  readonly first: number;
  readonly end: number;
}

/** One scene file in memory, as readers get it. */
export interface SceneSource {
  /** The whole file, as the server or disk gave it. */
  readonly bytes: Uint8Array;
  /** What error messages call the file: its name or URL. */
  readonly name: string;
  /** The account of the load: charged before anything is allocated that is not as long as what is at hand. */
  readonly budget: LoadBudget;
  /** Readers that wait or work long call `throwIfAborted()` between steps. */
  readonly signal?: AbortSignal;
  /** True if `bytes` are only the first of the file: the splats that are whole are read, attributes that are missing left out. */
  readonly isPrefix?: boolean;
  /** Only these splats are wanted; readers that cannot leave the others out do not know it. See `splatRanges`. */
  readonly range?: SplatRange;
  /** True for an SPZ that a glTF holds: its frame is the one of SPZ's specification. */
  readonly isWithinGltf?: boolean;
  /** Opens the files that a scene of several files names; absent where there is only the one. */
  readonly openPart?: OpenPart;
  /** Which level of a scene with levels of detail is read: 0 is the finest. `all`: all of them, in the runs that `GaussianCloud.levelRuns` tells. */
  readonly level?: number | 'all';
  /** See `ReadSceneOptions.mostSplats`. */
  readonly mostSplats?: number | undefined;
  /** Called with a part of the splats that stands for all, before the whole is read. See `ReadSceneOptions.onPreview`. */
  readonly onPreview?: (preview: GaussianCloud) => void | Promise<void>;
}

/** Smaller scenes are read as fast as a preview would be. */
const MIN_PREVIEWED = 50_000;

/** True if a preview was asked for, and a scene of `count` splats is large enough for one to be worth its time. */
export function previewWanted({ onPreview }: SceneSource, count: number): boolean {
  return onPreview !== undefined && count >= MIN_PREVIEWED;
}

/**
 * Opens another file of the same scene.
 *
 * @param path as the scene writes it: relative to the scene's own file, `/` between folders, not URL-encoded.
 * @param query what the scene appends for the server, from its `?` on; absent for nothing.
 * @returns the whole file.
 */
export type OpenPart = (path: string, query?: string) => Promise<Uint8Array>;

/**
 * Reads one file format into a cloud. A reader checks every size against the bytes present and charges it to the load's budget before it allocates, throws
 * `GaussianSplatError` with a code of the `decode` family (or `out-of-memory/budget`), and leaves it to `readScene`
 * to drop unusable splats.
 */
export type SceneReader = (source: SceneSource) => GaussianCloud | Promise<GaussianCloud>;

export type SceneFormatName =
  'ply' | 'compressed-ply' | 'spz' | 'splat' | 'ksplat' | 'sog' | 'lod' | 'gltf' | 'zip' | 'rad';

/** A file format that `readScene` reads: what it is called, how it is recognised, and where its reader is. */
export interface SceneFormat {
  readonly name: SceneFormatName;
  /** Name for readers. */
  readonly title: string;
  /** File extensions in lower case, with the dot. A format may share an extension with another. */
  readonly extensions: readonly string[];
  /** Media types seen in use; none of them is registered with IANA. */
  readonly mimeTypes: readonly string[];
  /** True if the first bytes of the file prove this format. Absent where the format has no signature. */
  readonly hasSignature?: (bytes: Uint8Array) => boolean;
  /** True if the reader can read a file whose end is missing: see `readPrefix`. */
  readonly readsPrefix?: boolean;
  /** True if the first bytes may be damaged and the name still be right: a reader then says what is wrong. */
  readonly isSignatureWeak?: boolean;
  /** Loads the reader; a dynamic import, so that a page fetches only the readers it needs. */
  readonly load: () => Promise<SceneReader>;
}
