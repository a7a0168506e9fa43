/** Fetches, reads and packs one scene. Runs in the worker, or on the main thread if workers are not available. */
import { boundsOf, Lazy, loadModule, type GaussianCloud } from '@gaussian-splat/core';
import type { InnerView } from '@gaussian-splat/core/views';
import {
  fetchScene,
  HEADER_BYTES,
  isSequence,
  fileOpenerFor,
  prepareReader,
  readScene,
  type FetchSceneOptions,
  type LoadLimits,
} from '@gaussian-splat/formats';
import { fileName, named, throttled } from './load-helpers.js';
import type { LargePly } from './large-ply.js';
import { ProgressSum } from './progress-sum.js';
import {
  HANDED_ON,
  type LoadedFacts,
  type LoadedScene,
  type LoadedSequence,
  type SceneRequest,
  type SentScene,
  type TaskListeners,
} from './protocol.js';

/** Delay of the first preview after the start of the load, ms. Shorter downloads need no preview. */
const PREVIEW_AFTER_MS = 300;
/**
 * A preview of a complete file is shown if reading it has taken this time, ms, because packing it will take about as
 * long; or if the preview has this number of splats, a sixteenth of the scene.
 */
const MIN_REST_MS = 500;
const MIN_PREVIEW_SPLATS = 1 << 16;
/** Minimum size in bytes of a file for which the code that packs large scenes is loaded before the file is read. */
const MANY_BYTES = 1 << 18;
/** Result if the code of previews cannot be loaded: the scene loads without previews. */
const none = (): undefined => undefined;

export { fileName, named, throttled };

/**
 * Loads a scene, or the manifest of a sequence of scenes. Throws GaussianSplatError (`network/*`, `decode/*`,
 * `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function loadScene(
  request: SceneRequest,
  signal: AbortSignal,
  listeners: TaskListeners,
): Promise<LoadedScene | SentScene | LoadedSequence> {
  const { onProgress, onPreview, onPart, onReading, handOn } = listeners;
  try {
    const { url, credentials } = request;
    const name = fileName(url);
    const limits = limitsFrom(request);
    const progress = new ProgressSum(throttled(onProgress), mayHaveParts(name));
    const options = (): FetchSceneOptions => ({
      ...{ mode: 'cors', credentials, signal, onProgress: progress.add() },
      ...fileLimits(limits()),
    });
    const packer = new Lazy('the code that packs scenes', () => import('./pack-cloud.js'));
    // A view that a preview of the whole scene has stays, because samples differ.
    let inside: InnerView | undefined;
    const factsOf = async (cloud: GaussianCloud, isPart = false): Promise<LoadedFacts> => {
      const bounds = boundsOf(cloud);
      if (!isPart) inside ??= (await packer.get()).innerViewOf(cloud, bounds);
      return {
        bounds: { ...bounds, inside, ...cloud.hints },
        warnings: cloud.warnings,
        order: cloud.hints?.order,
        hasMeshes: cloud.hints?.meshes,
        credits: cloud.hints?.credits,
      };
    };
    const pack = async (cloud: GaussianCloud, isPart?: boolean): Promise<LoadedScene> => ({
      packed: await (await packer.get()).packCloud(cloud, { sh: request.sh }),
      ...(await factsOf(cloud, isPart)),
    });
    /** Sends the blocks of a large cloud one after another, as the page uploads them. */
    const sendCloud = async (cloud: GaussianCloud): Promise<LoadedScene | SentScene> => {
      const { packCloudInto } = await packer.get();
      const facts = await factsOf(cloud);
      const packed = await packCloudInto(onPart!, cloud, { sh: request.sh });
      return packed ? { packed, ...facts } : facts;
    };
    if (request.streamBytes !== undefined) {
      const { loadWholeStream } = await loadModule('the code that streams scenes', () => import('./whole-stream.js'));
      const load = { name, limits, options, pack, onProgress, onPreview, onReading };
      return await loadWholeStream(request, request.streamBytes, signal, load);
    }
    const start = performance.now();
    const previews = new Lazy('the code of previews', async () => {
      const { PreviewSchedule } = await import('./preview-schedule.js');
      const within = { name, signal, ...limits() };
      const show = async (cloud: GaussianCloud): Promise<void> =>
        onPreview?.(await pack(cloud, !cloud.hints?.represented));
      return new PreviewSchedule(within, start, show, onReading);
    });
    const shared = new SharedReading(request, name, limits, listeners);
    let isPrepared = false;
    // Loads the code for the file while the rest of it is in transit. Failures are reported when the code is used.
    const prepare = (beginning: Uint8Array, total = 0): void => {
      void prepareReader(beginning, name);
      packer.get().then((code) => (total < MANY_BYTES ? undefined : code.prepareToPack()), none);
    };
    const onArrival = async (bytes: Uint8Array, total: number | undefined, first: number): Promise<boolean> => {
      if (!isPrepared) prepare(bytes, total);
      isPrepared = true;
      // `LargePly` shows its own previews.
      if (shared.mayBeShared(bytes, total, first))
        return (await (await shared.plyIn(bytes, total))?.onArrival(bytes, first)) ?? false;
      if (onPreview && performance.now() - start >= PREVIEW_AFTER_MS)
        await (await previews.get().catch(none))?.onArrival(bytes, total);
      return false;
    };
    const handed = await request.downloaded?.arrayBuffer().catch(none);
    let bytes: Uint8Array = handed ? new Uint8Array(handed) : await fetchScene(url, { ...options(), onArrival });
    const ply = await shared.ply;
    const joined = await ply?.finish();
    if (joined) return joined;
    // The bytes of a file that turned out to be unusual were not kept. The browser's cache usually has them.
    if (ply?.hasTaken) bytes = await fetchScene(url, options());
    if (!handed && handOn?.(bytes)) throw HANDED_ON;
    onReading?.(true);
    if (isSequence(bytes)) {
      const { parseSequence } = await loadModule('the code that reads sequences', () => import('./sequence-of.js'));
      return parseSequence(bytes, name);
    }
    if (request.groups !== undefined) {
      const { loadGrouped } = await loadModule('the code that reads groups', () => import('./grouped.js'));
      return await loadGrouped(bytes, request.groups, { name, signal, ...limits() }, pack);
    }
    // Files beside a `blob:` or `data:` URL do not exist.
    const openFile = /^(blob|data):/.test(url) ? undefined : fileOpenerFor(url, options);
    const level = request.levels ? 'all' : 0;
    const began = performance.now();
    const showPreview = async (cloud: GaussianCloud): Promise<void> => {
      if (performance.now() - began >= MIN_REST_MS || cloud.count >= MIN_PREVIEW_SPLATS)
        await (await previews.get().catch(none))?.onPreview(cloud);
    };
    const cloud = await readScene(bytes, {
      ...{
        name,
        signal,
        openFile,
        level,
        onPreview: onPreview && showPreview,
      },
      ...limits(),
    });
    signal.throwIfAborted();
    onReading?.(true);
    if (cloud.levelRuns === undefined) return onPart ? sendCloud(cloud) : pack(cloud);
    const { packLevels } = await loadModule('the code that packs levels of detail', () => import('./pack-levels.js'));
    return packLevels(cloud, request.sh);
  } catch (error) {
    signal.throwIfAborted();
    if (error === HANDED_ON) throw error;
    throw named(error, fileName(request.url));
  }
}

/**
 * Starts the time limit of a load. Returns a function that returns the limits, with the seconds that remain at each
 * call.
 */
export function limitsFrom({ limits }: Pick<SceneRequest, 'limits'>): () => LoadLimits {
  const start = performance.now();
  return () => ({ ...limits, maxSeconds: (limits?.maxSeconds ?? Infinity) - (performance.now() - start) / 1000 });
}

/**
 * Returns the limits of one download. It may use half of the bytes, because an unpacked scene takes about as much
 * memory as its file.
 */
export const fileLimits = ({ maxBytes = Infinity, maxSeconds }: LoadLimits): LoadLimits => ({
  maxBytes: maxBytes / 2,
  maxSeconds,
});

/** Minimum size in bytes of a PLY whose rows are packed while they arrive. */
const LARGE_BYTES = 1 << 22;

/** Reads a file in transit with several workers, if it is a PLY whose rows they can share. */
class SharedReading {
  readonly #of: readonly [name: string, request: SceneRequest, limits: () => LoadLimits, listeners: TaskListeners];
  #isRefused = false;
  /**
   * The shared PLY; undefined before its header has arrived. Resolves with undefined for a file that must be read as a
   * whole.
   */
  ply: Promise<LargePly | undefined> | undefined;

  constructor(request: SceneRequest, name: string, limits: () => LoadLimits, listeners: TaskListeners) {
    this.#of = [name, request, limits, listeners];
  }

  /**
   * Returns whether threads may share a file: a PLY of `LARGE_BYTES` or more that need not be read as a whole. `bytes`:
   * the received bytes; `total`: size of the file in bytes.
   */
  mayBeShared(bytes: Uint8Array, total = 0, first = 0): boolean {
    if (total < LARGE_BYTES || this.#isRefused || this.#of[1].groups !== undefined) return false;
    return first > 0 || (bytes[0] === 0x70 && bytes[1] === 0x6c && bytes[2] === 0x79);
  }

  async plyIn(bytes: Uint8Array, total = 0): Promise<LargePly | undefined> {
    if (bytes.length >= HEADER_BYTES) this.ply ??= this.#open(bytes, total);
    const ply = await this.ply;
    this.#isRefused = this.ply !== undefined && ply === undefined;
    return ply;
  }

  async #open(bytes: Uint8Array, total: number): Promise<LargePly | undefined> {
    const { LargePly } = await loadModule('the code that reads large PLY files', () => import('./large-ply.js'));
    return LargePly.open(bytes, total, ...this.#of);
  }
}

/** Returns whether a file may refer to other files, which then contain most bytes of the scene. */
function mayHaveParts(name: string): boolean {
  return /\.(json|gltf|lcc2?)$/i.test(name);
}
