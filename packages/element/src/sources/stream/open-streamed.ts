/** Opens streamed scenes on the GPU. */
import type { Credits, GaussianSplatError, TrainedOrder } from '@gaussian-splat/core';
import {
  MemoryLedger,
  pickInitialVariants,
  StreamedGaussians,
  type PageSource,
  type PoolOptions,
} from '@gaussian-splat/renderer';
import { maxSplatBudget } from '@gaussian-splat/renderer/tools';
import type { SceneRequest } from '../../loading/protocol.js';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import { LoadedGaussians, type OwnedGaussians } from '../../gpu/loaded-gaussians.js';
import { images, unlessWrong } from '../../gpu/initial-frames.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import type { LodSettings } from '../../gpu/backend.js';
import type { OpenOptions, OpenSource } from '../source-kind.js';
import { openSource } from '../source-kinds.js';
import { openPages } from './open-pages.js';
import { streamCaps } from './stream-caps.js';

interface StreamedOptions extends OpenOptions {
  /** Called when a part has arrived, so that another frame is needed. */
  readonly onChange: () => void;
}

/** A scene that is loaded in parts, after its coarsest part has arrived. */
interface OpenedStream {
  readonly gaussians: OwnedGaussians;
  readonly bounds: SceneBounds;
  readonly order?: TrainedOrder | undefined;
  readonly detail?: LodSettings;
  readonly warnings?: readonly string[];
  readonly credits?: Credits | undefined;
}

/** Fraction of the remaining memory budget that a streamed scene may use, because other scenes may follow. */
const SHARE_OF_REST = 0.5;
/** Maximum number of failures of parts that are reported. */
const MAX_WARNINGS = 16;
/** Allowed error in pixels. If the limit of splats does not allow it, the error is larger. */
const DETAIL = 1;

/**
 * Opens a streamed scene: fetches its manifest or index, and its coarsest level. Failures of parts are added to
 * `warnings` later. Resolves to undefined for a file without levels.
 * @throws GaussianSplatError `network/*`, `decode/*`, `out-of-memory/*`, or the signal's reason.
 */
async function openStreamed(
  request: SceneRequest,
  device: GPUDevice,
  options: StreamedOptions,
): Promise<OpenedStream | undefined> {
  const { signal, memoryBudget = Infinity, onChange, losses } = options;
  const caps = streamCaps();
  const share = 2 ** -losses;
  const warnings: string[] = [];
  const pool: PoolOptions = {
    // Computed when the pool is allocated. Beside many other scenes this scene is coarser, but it always has a slot.
    get memoryBudget() {
      const { budgetBytes, bytes } = MemoryLedger.of(device);
      return Math.min(memoryBudget, caps.bytes, SHARE_OF_REST * Math.max(0, budgetBytes - bytes));
    },
    signal,
    onChange,
    // The parent of a missing page stays visible. The page is requested repeatedly, but its failure is reported once.
    onError: (error) => {
      const sentence = error instanceof Error ? error.message : String(error);
      if (warnings.includes(sentence) || warnings.length === MAX_WARNINGS) return;
      warnings.push(sentence);
      console.warn(sentence);
    },
  };
  const opened = await openPages(request, { ...options, onError: pool.onError });
  if (!opened) return undefined;
  const { source, credits } = opened;
  const gaussians = await openWithin(device, source, pool, share, warnings);
  const { bounds, order } = gaussians;
  const { maxSplats = Infinity } = request.limits ?? {};
  const splatBudget = Math.min(share * caps.splats, maxSplats);
  // More splats than the pool holds are never drawn, and no more than at first after a loss.
  const limit = share < 1 ? caps.splats : maxSplatBudget(device);
  const max = Math.max(splatBudget, Math.min(maxSplats, gaussians.count, limit));
  const detail = { detail: DETAIL, splatBudget, splatRange: [splatBudget, max] as const };
  if (!signal.aborted) return { ...{ gaussians, bounds, order, warnings, credits }, detail };
  gaussians.destroy();
  throw signal.reason;
}

/**
 * Opens pages in as much memory as the device has: half as much after each refusal, which is added to the warnings. Levels
 * are coarser then.
 * @param share Fraction of the memory to begin with; all of it is used if the first page needs more.
 */
async function openWithin(
  device: GPUDevice,
  source: PageSource,
  pool: PoolOptions,
  share: number,
  warnings: string[],
): Promise<StreamedGaussians> {
  const { memoryBudget: wanted = 0 } = pool;
  let refusal: unknown;
  for (let memoryBudget = share * wanted; ; memoryBudget /= 2) {
    try {
      const opened = await StreamedGaussians.openSource(device, source, { ...pool, memoryBudget });
      if (refusal !== undefined) warnings.push(lessMemory(wanted, memoryBudget));
      return opened;
    } catch (error) {
      const { code } = error as GaussianSplatError;
      if (code === 'out-of-memory/budget' && memoryBudget < wanted) {
        // The last halves have no room for the first page.
        if (refusal !== undefined) throw refusal;
        return StreamedGaussians.openSource(device, source, pool);
      }
      if (code !== 'out-of-memory/allocation' && code !== 'out-of-memory/buffer-limit') throw error;
      refusal ??= error;
    }
  }
}

const lessMemory = (wanted: number, found: number): string =>
  `The device has too little memory for ${inMegabytes(wanted)} of pages: the scene has ${inMegabytes(found)}, and coarser levels.`;

const inMegabytes = (bytes: number): string => `${(bytes / 1e6).toFixed(1)} MB`;

/** Opens a streamed scene; a file without levels as a whole. */
export const open: OpenSource = async (request, options, acquiring) => {
  const lease = await acquiring;
  const opened: { scene?: LoadedGaussians } = {};
  const onChange = (): void => opened.scene?.onChange();
  await pickInitialVariants(lease.device, images()).catch(unlessWrong);
  limitScenes(lease.device, options.memoryBudget);
  options.signal.throwIfAborted();
  // The size of the scene is unknown until the manifest is loaded, so its limit is reported.
  options.beforeUpload(options.memoryBudget ?? 0);
  const streamed = await openStreamed(request, lease.device, { ...options, onChange });
  if (!streamed) return openSource({ ...request, isWhole: true }, options, acquiring);
  const { gaussians, bounds, ...rest } = streamed;
  opened.scene = new LoadedGaussians(lease, gaussians, bounds, options.submissions, rest);
  return opened.scene;
};
