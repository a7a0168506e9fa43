/** Plays clips of moving splats. The module is loaded only for clips. */
import { clipGroupAt, clipRooms, frameAt, unpackClipIndex, type ClipIndex } from '@gaussian-splat/formats';
import { GaussianSplatError, type Credits } from '@gaussian-splat/core';
import { AnimatedGaussians, pickInitialVariants } from '@gaussian-splat/renderer';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { images, unlessWrong } from '../../gpu/initial-frames.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import type { ProgressListener, SceneRequest } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import { GroupCache, partsIn, STILL } from './group-cache.js';
import { GroupSlots } from './group-slots.js';
import { PlayDirection } from '../play-direction.js';
import type { OpenSource } from '../source-kind.js';
import type { DynamicListeners, DynamicState, Timeline } from '../generator/dynamic-model.js';

export interface ClipOptions {
  readonly request: SceneRequest;
  readonly device: GPUDevice;
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  /** Called with the loaded bytes when parts of the clip have arrived, as a video fires `progress`. */
  readonly onProgress: ProgressListener;
  readonly listeners: DynamicListeners;
  readonly loops: () => boolean;
  /** Start position of playback, seconds. */
  readonly startSeconds: number;
  readonly memoryBudget: number | undefined;
}

/**
 * Plays a clip. Groups of frames are fetched ahead by byte ranges and uploaded once each; the GPU computes their
 * frames.
 */
export class ClipPlayer implements Timeline {
  readonly gaussians: AnimatedGaussians;
  readonly bounds: SceneBounds;
  readonly credits: Credits | undefined;
  readonly duration: number;
  readonly #index: ClipIndex;
  readonly #options: ClipOptions;
  readonly #cache: GroupCache;
  readonly #slots: GroupSlots;
  readonly #direction: PlayDirection;
  #isClosed = false;

  private constructor(options: ClipOptions, index: ClipIndex, gaussians: AnimatedGaussians, cache: GroupCache) {
    this.#options = options;
    this.#index = index;
    this.gaussians = gaussians;
    this.bounds = index.bounds;
    this.credits = index.credits;
    this.duration = index.durationSeconds;
    this.#cache = cache;
    this.#slots = new GroupSlots(gaussians, index);
    this.#direction = new PlayDirection(index.frameCount, index.framesPerSecond);
  }

  /**
   * Opens a clip. Resolves when the coarse part of the group at the start position is loaded. Rejects with
   * GaussianSplatError, or the signal's reason.
   */
  static async open(options: ClipOptions): Promise<ClipPlayer> {
    const { device, loader, request, signal, onProgress, memoryBudget, startSeconds, listeners } = options;
    const { url, credentials, limits, source } = request;
    const whole = await localFile(url);
    const opened = await loader.ask('clip', { url, credentials, limits, source, whole }, signal);
    const index = unpackClipIndex(opened.index);
    const file = opened.file ?? (opened.isPartial ? whole : new Blob([await loader.fetchFile(request, signal)]));
    const cache = new GroupCache(index, {
      fetchPart: (group, part, aborted) => {
        const { groups, shDegree, origin } = index;
        const frames = group === STILL ? 1 : groups[group].frames;
        const place = { url, credentials, limits, source, whole: file, tag: opened.tag };
        const own = { part: partsIn(index, group)[part], group, frames, shDegree, origin };
        return loader.ask('clip-part', { ...place, ...own }, aborted);
      },
      onArrival: () => {
        onProgress(file ? index.byteLength : cache.loadedBytes, index.byteLength);
        listeners.onInput();
      },
      onError: (error) => (isReplaced(error) ? listeners.onReplaced : listeners.onError)(error),
    });
    const first = clipGroupAt(index, frameAt(index, startSeconds));
    let gaussians: AnimatedGaussians | undefined;
    try {
      const arriving = cache.first(first, signal);
      arriving.catch(() => undefined);
      const still = index.still.map(({ splats, planes }) => ({ rows: splats, planes, frames: 1 }));
      gaussians = await AnimatedGaussians.create(device, { ...index, parts: clipRooms(index), still, memoryBudget });
      await arriving;
      signal.throwIfAborted();
      const player = new ClipPlayer(options, index, gaussians, cache);
      player.request({ timeSeconds: startSeconds });
      return player;
    } catch (error) {
      cache.close();
      gaussians?.destroy();
      throw error;
    }
  }

  get buffered(): readonly (readonly [number, number])[] {
    const { framesPerSecond, groups } = this.#index;
    const spans: [number, number][] = [];
    for (const k of this.#cache.loaded) {
      if (!this.#cache.canShow(k)) continue;
      const { first, frames } = groups[k];
      const [start, end] = [first / framesPerSecond, (first + frames) / framesPerSecond];
      const last = spans.at(-1);
      if (last && last[1] === start) last[1] = end;
      else spans.push([start, end]);
    }
    return spans;
  }

  loadedUntil(timeSeconds: number): number {
    const { groups, framesPerSecond } = this.#index;
    let group = clipGroupAt(this.#index, frameAt(this.#index, timeSeconds));
    while (group < groups.length && (this.#cache.canShow(group) || this.#cache.isMissing(group, 0))) group++;
    return group < groups.length ? Math.max(timeSeconds, groups[group].first / framesPerSecond) : Infinity;
  }

  /** Shows the frame at a time, if its group is loaded, and fetches the following groups. */
  request({ timeSeconds }: Pick<DynamicState, 'timeSeconds'>): void {
    const frame = frameAt(this.#index, timeSeconds);
    const group = clipGroupAt(this.#index, frame);
    const loops = this.#options.loops();
    this.#cache.want(group, loops, this.#direction.at(frame, loops));
    if (this.#slots.show(frame, group, this.#cache)) this.#options.listeners.onInput();
    if (this.#slots.shownFrame === frame || this.#cache.isMissing(group, 0))
      queueMicrotask(() => this.#isClosed || this.#options.listeners.onShown(timeSeconds));
  }

  close(): void {
    this.#isClosed = true;
    this.#cache.close();
  }
}

/** Returns whether an error says that the file was replaced on its server. */
const isReplaced = (error: unknown): boolean => error instanceof GaussianSplatError && error.code === 'network/changed';

/** Returns the content of a `blob:` address; undefined for other addresses. */
async function localFile(url: string): Promise<Blob | undefined> {
  return url.startsWith('blob:') ? (await fetch(url)).blob() : undefined;
}

/** Opens a clip at the time of its clock. */
export const open: OpenSource = async (request, options, acquiring) => {
  const lease = await acquiring;
  const { listeners, loops, state } = options.live();
  await pickInitialVariants(lease.device, images()).catch(unlessWrong);
  limitScenes(lease.device, options.memoryBudget);
  options.signal.throwIfAborted();
  // The size of the clip is unknown until its index is loaded, so its limit is reported.
  options.beforeUpload(options.memoryBudget ?? 0);
  const startSeconds = state().timeSeconds;
  const open = (): Promise<ClipPlayer> =>
    ClipPlayer.open({ ...options, request, device: lease.device, listeners, loops, startSeconds });
  // The file may be replaced between the requests for its index and its first frames.
  const player = await open().catch((error: unknown) => (isReplaced(error) ? open() : Promise.reject(error as Error)));
  return new LoadedGaussians(lease, player.gaussians, player.bounds, options.submissions, { live: player });
};
