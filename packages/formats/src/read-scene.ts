import { keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from './budget.js';
import { plainBytes, type FileBytes } from './bytes.js';
import { formatOf, loadDetection, loadDiagnosis, loadLeftOut, loadPreviews, loadReader } from './load-files.js';
import { emptyFile, noSplats, outOfMemory } from './scene-errors.js';
import { previewWanted, type OpenFile, type SceneSource } from './scene-format.js';

/** Maximum fraction of a file's splats, 0..1, that may be dropped without a warning. */
export const MAX_DROPPED_RATIO = 0.05;

export interface ReadSceneOptions extends LoadLimits {
  /** File name or URL for error messages. Its extension identifies formats without a signature. Default `scene`. */
  readonly name?: string;
  /** Media type from the server, which identifies formats without a signature or an extension. */
  readonly contentType?: string;
  /** Aborts the reading at its next step; the promise then rejects with the signal's reason. */
  readonly signal?: AbortSignal;
  /**
   * Opens the other files of a scene with several files: SOG folders, streamed SOG, and glTF with external buffers.
   * `fileOpenerFor` returns this function for a URL. Archives do not need it.
   */
  readonly openFile?: OpenFile;
  /**
   * Level of detail of a streamed scene to read: 0 (default) is the finest. `all` reads all levels, for renderers that
   * select among them; see `GaussianCloud.levelRuns`.
   */
  readonly level?: number | 'all';
  /**
   * Maximum number of splats. Of streamed SOG, LCC and 3D Tiles, the finest level within this limit is read. Scenes that
   * exceed the limit are rejected with `out-of-memory/budget`, also those with levels if the coarsest exceeds it.
   */
  readonly maxSplats?: number;
  /**
   * Called with a preview of scenes with 50,000 splats or more, before reading has completed. The preview has a part of
   * the splats from the whole scene, enlarged to represent the others. Reading continues when the promise resolves.
   */
  readonly onPreview?: (preview: GaussianCloud) => void | Promise<void>;
}

/**
 * Starts to load the reader of a file that is still loading, so that {@link readScene} need not wait for it. Unknown
 * files and failures have no effect.
 * @param beginning The first bytes of the file.
 */
export async function prepareReader(beginning: FileBytes, name = 'scene', contentType = ''): Promise<void> {
  try {
    const bytes = plainBytes(beginning, name);
    const format = await formatOf(bytes, name, contentType);
    if (format) await loadReader(format);
  } catch {
    // `readScene` reports the failure.
  }
}

/**
 * Reads a scene file: PLY (INRIA layout), compressed PLY, SPZ version 1 to 4, SOG version 1 and 2, streamed SOG, glTF
 * with `KHR_gaussian_splatting`, .splat, .ksplat, or a ZIP archive of one of these; the format is detected from the
 * content. Works in windows, workers and Node; the reader of the format is loaded on demand.
 *
 * @param file The whole file. It is not modified, and the cloud does not share its memory.
 * @returns The splats in the structure and coordinates that `GaussianCloud` documents. Unusable splats are dropped and
 * counted in `droppedCount`; `warnings` reports other content that is not drawn.
 * @throws GaussianSplatError with a `decode/...` code that states the expected and found content, the place and a
 * remedy, `argument/value` for an argument without bytes, `out-of-memory/budget` for a file that needs more than its
 * bytes or the limits in `options` allow, or `out-of-memory/allocation`; the reason of `signal`, usually a DOMException
 * named AbortError, once it is aborted.
 */
export async function readScene(file: FileBytes, options: ReadSceneOptions = {}): Promise<GaussianCloud> {
  const { name = 'scene', contentType = '', signal, openFile, level, maxSplats, onPreview } = options;
  signal?.throwIfAborted();
  const bytes = plainBytes(file, name);
  if (bytes.length === 0) throw emptyFile(name);
  const format = await formatOf(bytes, name, contentType);
  if (!format) {
    const [{ extensionOf }, { diagnose }] = [await loadDetection(), await loadDiagnosis()];
    signal?.throwIfAborted();
    throw diagnose(bytes, name, extensionOf(name));
  }
  const read = await loadReader(format);
  signal?.throwIfAborted();
  let hasPreview = false;
  const preview = async (part: GaussianCloud): Promise<void> => {
    hasPreview = true;
    const drawable = keepUsable(part);
    if (drawable.count > 0) await onPreview?.(drawable);
    signal?.throwIfAborted();
  };
  const budget = new LoadBudget(bytes.length, options);
  const known = new Set<string>();
  const openPlain =
    openFile &&
    (async (path: string, query = '') => {
      budget.request(name);
      const part = plainBytes(await openFile(path, query || undefined), path);
      // A file that is opened again does not raise the limit of the budget again, and a reader may keep each copy.
      if (known.has(path + query)) budget.take(part.length, name);
      else budget.arrive(part.length);
      known.add(path + query);
      return part;
    });
  const source: SceneSource = {
    ...{ bytes, name, budget, signal, openFile: openPlain, level, maxSplats },
    onPreview: onPreview && preview,
  };
  const whole = await (async () => read(source))().catch((error: unknown) => {
    throw outOfMemory(error, name) ?? error;
  });
  signal?.throwIfAborted();
  // Validation and packing of all splats take longer than reading them, so that a preview is still useful.
  if (!hasPreview && previewWanted(source, whole.count)) {
    const { samplePreview } = await loadPreviews();
    await preview(samplePreview(whole));
  }
  const cloud = keepUsable(whole);
  signal?.throwIfAborted();
  const { count, droppedCount } = cloud;
  if (count === 0) throw noSplats(name, cloud);
  if (droppedCount <= MAX_DROPPED_RATIO * (count + droppedCount)) return cloud;
  const { withLeftOut } = await loadLeftOut();
  return withLeftOut(cloud, name);
}
