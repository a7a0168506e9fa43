/** Opens streamed scenes: manifests of pages (docs/lod-format.md), streamed SOG by boxes, and trees node by node. */
import { fileRequest } from '@gaussian-splat/core/fetch';
import type { Credits, TrainedOrder } from '@gaussian-splat/core';
import { MemoryLedger, pickInitialVariants, StreamedGaussians, type PoolOptions } from '@gaussian-splat/renderer';
import { levelSource, treeSource } from '@gaussian-splat/renderer/tools';
import type { SceneLimits, SceneRequest } from '../../loading/protocol.js';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import { LoadedGaussians, type OwnedGaussians } from '../../gpu/loaded-gaussians.js';
import { images, unlessWrong } from '../../gpu/initial-frames.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import type { LodSettings } from '../../gpu/backend.js';
import type { OpenOptions, OpenSource } from '../source-kind.js';
import { nameIn, openSource } from '../source-kinds.js';
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
  const { signal, memoryBudget = Infinity, onChange } = options;
  const caps = streamCaps();
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
  const name = nameIn(request.url);
  const open = /detail\.json$/i.test(name) ? openPages : /lod-meta\.json$/i.test(name) ? openBoxes : openNodes;
  const streamed = await open(request, device, options, pool);
  if (!streamed) return undefined;
  const { gaussians, credits } = streamed;
  const { bounds, order } = gaussians;
  const splatBudget = Math.min(caps.splats, request.limits?.maxSplats ?? Infinity);
  if (!signal.aborted)
    return { ...{ gaussians, bounds, order, warnings, credits }, detail: { detail: DETAIL, splatBudget } };
  gaussians.destroy();
  throw signal.reason;
}

/**
 * Limits of the downloads of one scene. They apply to the sum of all of its parts; a part that is fetched again counts
 * once.
 */
class Allowance {
  readonly #limits: SceneLimits;
  readonly #bytes = new Map<string, number>();
  #sum = 0;

  constructor(limits: SceneLimits = {}) {
    this.#limits = limits;
  }

  /** Returns the limits for a part: the bytes that the other parts leave. */
  of(part: string): SceneLimits {
    const { maxBytes = Infinity } = this.#limits;
    const others = this.#sum - (this.#bytes.get(part) ?? 0);
    return { ...this.#limits, maxBytes: Math.max(0, maxBytes - others) };
  }

  async note<T extends { readonly byteLength: number }>(part: string, coming: Promise<T>): Promise<T> {
    const bytes = await coming;
    this.#sum += bytes.byteLength - (this.#bytes.get(part) ?? 0);
    this.#bytes.set(part, bytes.byteLength);
    return bytes;
  }
}

type Open = (
  request: SceneRequest,
  device: GPUDevice,
  options: StreamedOptions,
  pool: PoolOptions,
) => Promise<{ readonly gaussians: StreamedGaussians; readonly credits: Credits | undefined } | undefined>;

const openPages: Open = async (request, device, { loader, signal, onProgress }, pool) => {
  const { limits = {} } = request;
  const allowance = new Allowance(limits);
  const manifest = await loader.ask('manifest', request, signal, { onProgress });
  const { attribution, license } = manifest;
  const gaussians = await StreamedGaussians.open(device, manifest, {
    ...pool,
    isDecoded: true,
    fetchPage: async (page, aborted, coded) => {
      const part = fileRequest(page, request, limits.origins);
      const own = { ...part, limits: allowance.of(part.url), source: request.source, coded };
      return allowance.note(part.url, loader.fetchFile(own, aborted));
    },
  });
  return { gaussians, credits: attribution || license ? { attribution, license } : undefined };
};

const openBoxes: Open = async (request, device, { loader, signal, onProgress }, pool) => {
  const { levels, files, runs, firstRuns, credits } = await loader.ask('boxes', request, signal, { onProgress });
  const { url, credentials } = request;
  const allowance = new Allowance(request.limits);
  const source = levelSource(levels, async (page, aborted) => {
    const [file, first, count] = runs.subarray(3 * (firstRuns[page.box] + page.level));
    const part = `${page.box} ${page.level}`;
    const place = { url, path: files[file], first, count };
    const own = { credentials, limits: allowance.of(part), source: request.source };
    const box = { ...place, ...own, page, scene: levels.scene };
    return new Uint32Array(await allowance.note(part, loader.ask('box', box, aborted)));
  });
  return { gaussians: await StreamedGaussians.openSource(device, source, pool), credits };
};

const openNodes: Open = async (request, device, { loader, signal, onProgress }, pool) => {
  const answer = await loader.ask('tree', request, signal, { onProgress });
  if (!answer) return undefined;
  const { tree, warnings, ...opened } = answer;
  const report = (sentences: readonly string[]): void =>
    sentences.forEach((sentence) => pool.onError?.(new Error(sentence)));
  report(warnings);
  const { url, credentials, source: from } = request;
  const allowance = new Allowance(request.limits);
  const source = treeSource(opened, async (node, above, aborted) => {
    const part = above.join(' ');
    const own = { credentials, limits: allowance.of(part), source: from };
    // The worker needs the volumes of the children alone.
    const bare = { ...node, children: node.children.map(({ volume }) => ({ volume, children: [] })) };
    const page = await loader.ask('node', { url, ...own, tree, node: bare, scene: opened.scene, above }, aborted);
    await allowance.note(part, Promise.resolve(page.words));
    report(page.warnings);
    return page;
  });
  return { gaussians: await StreamedGaussians.openSource(device, source, pool), credits: opened.credits };
};

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
