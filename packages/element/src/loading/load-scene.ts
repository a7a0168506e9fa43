/** Fetches, reads and packs one scene, in the worker, or on the main thread if workers are not available. */
import { boundsOf, Lazy, loadModule, type GaussianCloud } from '@gaussian-splat/core';
import {
  fetchScene,
  HEADER_BYTES,
  isSequence,
  fileOpenerFor,
  readScene,
  type FetchSceneOptions,
  type LoadLimits,
} from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import { fileName, named, throttled } from './load-helpers.js';
import type { LargePly } from './large-ply.js';
import type * as sequences from './sequence-of.js';
import { ProgressSum } from './progress-sum.js';
import type {
  LoadedScene,
  LoadedSequence,
  PartListener,
  PreviewListener,
  ProgressListener,
  SceneRequest,
  SentScene,
} from './protocol.js';

/** Shorter downloads need no preview. */
const PREVIEW_AFTER_MS = 300;
/** A scene loads even without the code of previews. */
const none = (): undefined => undefined;

export { fileName, named, throttled };

/** Listeners of a load. */
export interface LoadListeners {
  readonly onProgress: ProgressListener;
  /** Absent: no previews. */
  readonly onPreview?: PreviewListener | undefined;
  /** Takes the splats of a large scene while they are put in order. Absent: they come with the scene. */
  readonly onPart?: PartListener | undefined;
  /** Called before the thread is busy for a while, and during that; with false when it has time again. */
  readonly onReading?: (isReading: boolean) => void;
  /**
   * Requests other workers for the packing.
   * @param most Maximum number.
   * @param onHelper Is called with a port to each of them when it is available.
   */
  readonly askForHelp?: (max: number, onHelper: (port: MessagePort) => void) => void;
}

/**
 * Loads one scene, or the manifest of several. Throws GaussianSplatError (`network/*`, `decode/*`,
 * `out-of-memory/allocation`), or the signal's reason once that is aborted.
 */
export async function loadScene(
  request: SceneRequest,
  signal: AbortSignal,
  listeners: LoadListeners,
): Promise<LoadedScene | SentScene | LoadedSequence> {
  const { onProgress, onPreview, onReading, askForHelp } = listeners;
  try {
    const { url, credentials } = request;
    const name = fileName(url);
    const limits = limitsFrom(request);
    const progress = new ProgressSum(throttled(onProgress), mayHaveParts(name));
    const options = (): FetchSceneOptions => ({
      ...{ mode: 'cors', credentials, signal, onProgress: progress.add() },
      ...fileLimits(limits()),
    });
    const pack = (cloud: GaussianCloud, bounds = boundsOf(cloud)): LoadedScene => ({
      packed: packGaussians(cloud, { sh: request.sh }),
      bounds: { ...bounds, up: cloud.hints?.up },
      warnings: cloud.warnings,
      order: cloud.hints?.order,
      hasMeshes: cloud.hints?.meshes,
    });
    if (request.streamBytes !== undefined) {
      const { loadWholeStream } = await loadModule('the code that streams scenes', () => import('./whole-stream.js'));
      const load = { name, limits, options, pack, onProgress, onPreview, onReading };
      return await loadWholeStream(request, request.streamBytes, signal, load);
    }
    const start = performance.now();
    const previews = new Lazy('the code of previews', async () => {
      const { PreviewSchedule } = await import('./preview-schedule.js');
      return new PreviewSchedule(name, signal, start, (cloud) => onPreview?.(pack(cloud)), onReading);
    });
    const shared = askForHelp && new SharedReading(request, name, limits, signal, listeners);
    const onArrival = async (bytes: Uint8Array, total: number | undefined): Promise<void> => {
      // A large PLY has its own previews.
      if (shared?.mayBeShared(bytes, total)) await (await shared.plyIn(bytes, total))?.onArrival(bytes);
      else if (onPreview && performance.now() - start >= PREVIEW_AFTER_MS)
        await (await previews.get().catch(none))?.onArrival(bytes, total);
    };
    const bytes = await fetchScene(url, { ...options(), onArrival });
    onReading?.(true);
    const joined = await (await shared?.ply)?.finish(bytes);
    if (joined) return joined;
    if (isSequence(bytes)) {
      const { parseSequence } = await loadSequenceCode();
      return parseSequence(bytes, name);
    }
    // Blob and data URLs have no sibling files.
    const openFile = /^(blob|data):/.test(url) ? undefined : fileOpenerFor(url, options);
    const level = request.levels ? 'all' : 0;
    const cloud = await readScene(bytes, {
      ...{
        name,
        signal,
        openFile,
        level,
        onPreview: onPreview && (async (cloud) => (await previews.get().catch(none))?.onPreview(cloud)),
      },
      ...limits(),
    });
    signal.throwIfAborted();
    onReading?.(true);
    if (cloud.levelRuns === undefined) return pack(cloud);
    const { packLevels } = await loadModule('the code that packs levels of detail', () => import('./pack-levels.js'));
    return packLevels(cloud, request.sh);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, fileName(request.url));
  }
}

export const loadSequenceCode = (): Promise<typeof sequences> =>
  loadModule('the code that reads sequences', () => import('./sequence-of.js'));

/** The limits of a load that starts now, with the remaining seconds at each call. */
export function limitsFrom({ limits }: Pick<SceneRequest, 'limits'>): () => LoadLimits {
  const start = performance.now();
  return () => ({ ...limits, maxSeconds: (limits?.maxSeconds ?? Infinity) - (performance.now() - start) / 1000 });
}

/** Limits for one file: a scene takes as much again as its file. */
export const fileLimits = ({ maxBytes = Infinity, maxSeconds }: LoadLimits): LoadLimits => ({
  maxBytes: maxBytes / 2,
  maxSeconds,
});

/** Minimum size in bytes of a PLY whose rows several workers share. */
const LARGE_BYTES = 1 << 25;

/** Determines whether a file in transit is a PLY whose rows several workers can share. */
class SharedReading {
  readonly #of: readonly [
    name: string,
    request: SceneRequest,
    limits: () => LoadLimits,
    signal: AbortSignal,
    listeners: LoadListeners,
  ];
  #isRefused = false;
  /** Undefined for any other file. */
  ply: Promise<LargePly | undefined> | undefined;

  constructor(
    request: SceneRequest,
    name: string,
    limits: () => LoadLimits,
    signal: AbortSignal,
    listeners: LoadListeners,
  ) {
    this.#of = [name, request, limits, signal, listeners];
  }

  /** Whether it is a large PLY, unless its rows must be read in order. */
  mayBeShared(bytes: Uint8Array, total = 0): boolean {
    return total >= LARGE_BYTES && bytes[0] === 0x70 && bytes[1] === 0x6c && bytes[2] === 0x79 && !this.#isRefused;
  }

  async plyIn(bytes: Uint8Array, total = 0): Promise<LargePly | undefined> {
    if (bytes.length >= HEADER_BYTES) this.ply ??= this.#open(bytes, total);
    const ply = await this.ply;
    this.#isRefused = this.ply !== undefined && ply === undefined;
    return ply;
  }

  async #open(bytes: Uint8Array, total: number): Promise<LargePly | undefined> {
    const { LargePly } = await loadModule('the code that shares the reading of PLY', () => import('./large-ply.js'));
    return LargePly.open(bytes, total, ...this.#of);
  }
}

/** Whether the named file may be the smaller part of the scene. */
function mayHaveParts(name: string): boolean {
  return /\.(json|gltf)$/i.test(name);
}
