/**
 * Loads streamed scenes that are drawn without pages, coarsest parts first, as much of them as fits into memory. The
 * worker loads this module for the first such scene.
 */
import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { fileRequest } from '@gaussian-splat/core/fetch';
import {
  creditsOf,
  fetchScene,
  fileOpenerFor,
  readScene,
  type FetchSceneOptions,
  type LoadLimits,
} from '@gaussian-splat/formats';
import type { DetailManifest } from '@gaussian-splat/renderer';
import {
  cloudOfChunks,
  constants,
  decodePage,
  finestPages,
  listPages,
  pageLayout,
  type InstanceList,
} from '@gaussian-splat/renderer/tools';
import { openManifest } from './open-manifest.js';
import type { LoadedScene, SceneRequest, TaskListeners } from './protocol.js';

/** GPU memory of a splat in bytes, with harmonics of degree 3 in 8 bits, and with data of each frame: see `glBytes`. */
const SPLAT_BYTES = 4 * (8 + 14 + 9);
/** Factor by which the number of pages grows from one preview to the next. */
const GROWTH = 8;

/** Limits, listeners and functions of the load of a scene. */
export interface StreamLoad extends Pick<TaskListeners, 'onProgress' | 'onPreview' | 'onReading'> {
  readonly name: string;
  readonly limits: () => LoadLimits;
  /** Returns the options of another download, which adds to the progress. */
  readonly options: () => FetchSceneOptions;
  readonly pack: (cloud: GaussianCloud) => Promise<LoadedScene>;
}

/**
 * Loads the finest version of a streamed scene that fits into memory, from its `lod-meta.json` or `detail.json`. Throws
 * as `loadScene` does.
 * @param memory Maximum GPU memory of the scene, in bytes.
 */
export async function loadWholeStream(
  request: SceneRequest,
  memory: number,
  signal: AbortSignal,
  load: StreamLoad,
): Promise<LoadedScene> {
  const maxSplats = Math.max(constants.CULL_GROUP, Math.floor(memory / SPLAT_BYTES));
  if (!new URL(request.url).pathname.endsWith('detail.json')) return loadSog(request, maxSplats, signal, load);
  return loadPages(request, maxSplats, signal, load);
}

async function loadSog(
  { url }: SceneRequest,
  maxSplats: number,
  signal: AbortSignal,
  { name, limits, options, pack, onPreview, onReading }: StreamLoad,
): Promise<LoadedScene> {
  const bytes = await fetchScene(url, options());
  onReading?.(true);
  const cloud = await readScene(bytes, {
    ...{ name, signal, maxSplats, openFile: fileOpenerFor(url, options), ...limits() },
    onPreview: onPreview && (async (preview) => onPreview(await pack(preview))),
  });
  return pack(cloud);
}

/** Reads the pages of a `detail.json`, from the roots down, until the next page does not fit. */
async function loadPages(
  request: SceneRequest,
  maxSplats: number,
  signal: AbortSignal,
  { options, pack, onProgress, onPreview, onReading }: StreamLoad,
): Promise<LoadedScene> {
  const manifest = await openManifest(request, signal, { onProgress });
  if (manifest.geometry === undefined) throw ofVersion1(request.url);
  const list = listPages(manifest);
  const pages = finestPages(list, Math.floor(maxSplats / constants.CULL_GROUP));
  const words = new Map<string, Uint32Array<ArrayBuffer>>();
  let fetched = 0;
  let due = 1;
  for (const [k, page] of pages.entries()) {
    signal.throwIfAborted();
    const { file } = list.place(page);
    if (!words.has(file.file)) {
      const { maxBytes = Infinity, ...rest } = options();
      const part = fileRequest(file.file, request, request.limits?.origins);
      const bytes = await fetchScene(part.url, {
        ...rest,
        credentials: part.credentials,
        maxBytes: maxBytes - fetched,
      });
      fetched += bytes.length;
      words.set(file.file, await wordsOf(part.url, bytes, file, manifest));
    }
    if (onPreview === undefined || k + 1 < due || k + 1 === pages.length) continue;
    onReading?.(true);
    onPreview(await pack(cloudOf(manifest, list, pages.slice(0, k + 1), words)));
    onReading?.(false);
    due = GROWTH * (k + 1);
  }
  onReading?.(true);
  return {
    ...(await pack(cloudOf(manifest, list, pages, words))),
    ...{ order: manifest.order, credits: creditsOf(manifest) },
  };
}

/**
 * Returns the words of a file of pages, in the GPU layout of streamed scenes. Throws GaussianSplatError (`decode/*`) if
 * its length or its coding is invalid.
 */
async function wordsOf(
  where: string,
  bytes: Uint8Array,
  { chunks, upper }: { readonly chunks: number; readonly upper: number },
  manifest: DetailManifest,
): Promise<Uint32Array<ArrayBuffer>> {
  const { coding, shDegree } = manifest;
  // Copied to a buffer of exactly the file's length.
  const own = new Uint8Array(bytes);
  if (coding) return new Uint32Array(await decodePage(where, own, { chunks, upper, shDegree, coding }));
  const { total } = pageLayout(manifest, chunks);
  if (own.length === 4 * total) return new Uint32Array(own.buffer);
  throw new GaussianSplatError(own.length < 4 * total ? 'decode/truncated' : 'decode/corrupt', {
    where,
    expected: `${4 * total} bytes`,
    found: String(own.length),
    remedy: 'write the folder again with gaussian-splat detail, and upload all files of it',
  });
}

/** Returns the splats of some pages, without the chunks that other pages of them refine. */
function cloudOf(
  manifest: DetailManifest,
  list: InstanceList,
  pages: readonly number[],
  words: ReadonlyMap<string, Uint32Array<ArrayBuffer>>,
): GaussianCloud {
  const shown = new Set(pages);
  const parts = pages.map((page) => {
    const { file, first, chunks } = list.place(page);
    const below = list.children.subarray(list.firstChunk[page], list.firstChunk[page] + chunks);
    const own = Array.from({ length: chunks }, (_, c) => c).filter((c) => !shown.has(below[c]));
    return {
      ...{ words: words.get(file.file)!, of: file.chunks, translate: list.translate(page) },
      chunks: own.map((c) => first + c),
    };
  });
  return cloudOfChunks(manifest, parts);
}

const ofVersion1 = (where: string): GaussianSplatError =>
  new GaussianSplatError('decode/unsupported', {
    where,
    expected: 'pages of version 2 or 4, where WebGL 2 draws',
    found: 'version 1',
    remedy: 'write the folder again with gaussian-splat detail',
  });
