import { loadModule } from '@gaussian-splat/core';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { toElementError, type ElementError } from '../errors.js';
import type * as comeBack from '../gpu/come-back.js';
import { delay, DeviceLostError, isDeviceFailure, pageVisible } from '../gpu/device-failures.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { isStreamed, openScene, type openGaussians, type OpenOptions } from '../gpu/open-scene.js';
import type { ProgressListener, SceneRequest } from '../loading/protocol.js';
import { LatestTask } from '../latest-task.js';
import { isSameContract } from '../loading/same-contract.js';
import type { Services } from '../stage-host.js';
import { timerMs } from '../attributes.js';

/** `waiting`: there is a scene to load, but the element is not in sight yet. */
export type SceneState = 'empty' | 'waiting' | 'loading' | 'ready' | 'failed';

/** How a scene comes on show: as a `new` one, in place of a preview of it (`whole`), or `again` after a lost device. */
export type Entrance = 'new' | 'whole' | 'again';

/** What the controller needs of its element, and what it tells it. */
export interface SceneHost {
  readonly services: Services;
  /** Whether anybody would see what there is of a scene while it loads. */
  readonly wantsPreviews: boolean;
  /** Bytes of GPU memory that the scene may take. */
  readonly memoryBudget: number | undefined;
  /** What a generator needs to know beyond the request. */
  readonly liveRequest: ReturnType<OpenOptions['live']>;
  /** Opens what is no scene of splats. */
  readonly open?: typeof openGaussians;
  /** Shows a scene; fulfils once its first frame is drawn. */
  show(scene: LoadedGaussians, entrance: Entrance): Promise<void>;
  /** The scene on show is about to be destroyed, with (`clear`) or without its picture. */
  hide(clear: boolean): void;
  /** A preview of the scene is on show. */
  previewShown(preview: LoadedGaussians): void;
  loadStarted(): void;
  progressed(...progress: Parameters<ProgressListener>): void;
  loaded(url: string): void;
  /** There is no scene any more, or another is wanted in its place. */
  emptied(): void;
  failed(error: ElementError): void;
  contextChanged(event: 'contextlost' | 'contextrestored'): void;
}

type DeviceBack = (typeof comeBack)['deviceBack'];

/** Why no device is asked for any more, at first. */
interface GivenUp {
  readonly signal: AbortSignal;
  readonly error: unknown;
  readonly loss: GPUDeviceLostInfo | undefined;
  readonly mayReturn: boolean;
}

/** So many failures in a row to bring a lost device back are final. */
const MAX_FAILURES = 2;
/** Pause before the second try, ms: a GPU process that has just crashed needs a moment. */
const RETRY_DELAY_MS = 1_000;

/** A preview is kept while the whole scene is uploaded if that is so many times as large: both take memory then. */
const MIN_GROWTH = 4;

/** How many more submissions a frame is divided into after each loss, and where that ends: the picture is the same. */
const SUBMISSIONS_GROWTH = 4;
const MOST_SUBMISSIONS = 64;

/**
 * Life of the element's scene: load, replace (the latest request wins), recover after the loss of the device, release.
 * What still runs for an older request finds its signal aborted and does nothing.
 */
export class SceneController implements ReactiveController {
  readonly #host: ReactiveControllerHost;
  readonly #of: SceneHost;
  #state: SceneState = 'empty';
  #error: ElementError | null = null;
  #scene: LoadedGaussians | null = null;
  #isPreview = false;
  /** What the scene on show was asked for by. */
  #shownRequest: SceneRequest | null = null;
  #request: SceneRequest | null = null;
  readonly #running = new LatestTask();
  #releaseTimer: ReturnType<typeof setTimeout> | undefined;
  #waiters: (() => void)[] = [];
  /** Undefined until it has been in sight. */
  #isUnseen: boolean | undefined;
  /** It was dropped out of sight, and is to come back. */
  #isAway = false;
  /** A loss was told that no recovery has answered yet; another scene may do so. */
  #isContextLost = false;
  /** Grows with every loss of the device: a frame that ran too long for the driver may have been the cause. */
  #submissions = 1;

  constructor(host: ReactiveControllerHost, of: SceneHost) {
    this.#host = host;
    this.#of = of;
    host.addController(this);
  }

  get state(): SceneState {
    return this.#state;
  }

  get error(): ElementError | null {
    return this.#error;
  }

  /** Absolute address of what was asked for last; empty for nothing. */
  get url(): string {
    return this.#request?.url ?? '';
  }

  /** The request of the scene on show; null while there is none. */
  get shownRequest(): SceneRequest | null {
    return this.#scene && !this.isPreview ? this.#shownRequest : null;
  }

  /** The scene on show. */
  get scene(): LoadedGaussians | null {
    return this.#scene;
  }

  /** The scene on show is a preview of the one that is being loaded. */
  get isPreview(): boolean {
    return this.#isPreview && this.#scene !== null;
  }

  /** Another scene will take the place of the one on show. */
  get isOutgoing(): boolean {
    return this.#shownRequest !== this.#request;
  }

  /** Fulfils, and never rejects, once nothing is left to wait for: shown, failed or given up. */
  get settled(): Promise<void> {
    if (this.#state !== 'waiting' && this.#state !== 'loading') return Promise.resolve();
    return new Promise((resolve) => this.#waiters.push(resolve));
  }

  /** Whether a request, null for none, is for another scene than the last one. */
  isOther(request: SceneRequest | null): boolean {
    return request === null ? this.#request !== null : !isSame(request, this.#request);
  }

  /**
   * The scene that ought to be shown, or null for none. Safe to call as often as one likes: only a real change acts.
   * @param mayStart false while a lazy element is out of sight.
   */
  want(request: SceneRequest | null, mayStart: boolean): void {
    if (request === null) return this.#state === 'empty' ? undefined : this.#clear();
    if (this.isOther(request)) {
      const isSwap = this.#request !== null;
      this.#running.renew();
      this.#isAway = false;
      this.#submissions = 1;
      this.#request = request;
      this.#error = null;
      this.#setState('waiting');
      if (isSwap) this.#of.emptied();
    } else if (request.sh !== this.#request?.sh) {
      if (!this.isOutgoing) this.#shownRequest = request;
      this.#request = request;
      void this.#refine();
    }
    if (this.#state === 'waiting' && mayStart) void this.#load(request);
  }

  /** Whether the scene is in sight. One that has been, and is not any more, may be dropped; it comes back, unnoticed, in sight. */
  see(isSeen: boolean): void {
    if (!isSeen && this.#isUnseen === undefined) return;
    this.#isUnseen = !isSeen;
    if (isSeen && this.#isAway) void this.#attempt(this.#request!, this.#running.renew(), false, () => undefined);
    if (isSeen) this.#isAway = false;
    this.#setReleasable(false);
  }

  /**
   * Gives up: the scene cannot be drawn.
   * @param clear false keeps the last picture
   */
  fail(error: unknown, clear = true): void {
    this.#running.renew();
    const wasShown = this.#state === 'ready' || (this.#scene !== null && !this.isOutgoing);
    this.#drop(clear);
    this.#error = toElementError(error);
    this.#setState('failed');
    if (wasShown) this.#of.emptied();
    this.#of.failed(this.#error);
  }

  hostConnected(): void {
    clearTimeout(this.#releaseTimer);
    this.#releaseTimer = undefined;
    this.#setReleasable(false);
  }

  hostDisconnected(): void {
    this.#setReleasable(true);
    this.#releaseTimer = setTimeout(() => this.want(null, false), timerMs(this.#of.services.releaseDelay));
  }

  async #load(request: SceneRequest): Promise<void> {
    const { signal } = this.#running;
    this.#setState('loading');
    let loaded = 0;
    let total: number | undefined;
    const report: ProgressListener = (nextLoaded, nextTotal, share) => {
      [loaded, total] = [nextLoaded, nextTotal];
      if (!signal.aborted) this.#of.progressed(loaded, total, share);
    };
    this.#of.loadStarted();
    report(0, undefined);
    await this.#attempt(request, signal, true, report);
    if (signal.aborted || this.#scene === null) return;
    if (loaded !== total) report(loaded, loaded);
    this.#setState('ready');
    this.#of.loaded(request.url);
    this.#tellRestored();
    void this.#refine();
  }

  /** The same scene with colours as exact as they are asked for now. What is on show stays until they are there, and if they cannot be had. */
  async #refine(): Promise<void> {
    const [request, scene] = [this.#request, this.#scene];
    if (this.#state !== 'ready' || request === null || scene === null || scene.live || isStreamed(request)) return;
    const { shPrecision, shDegree } = scene.gaussians;
    if (request.sh === 'auto' || request.sh === shPrecision || shDegree === 0) return;
    const signal = this.#running.renew();
    const again: SceneRequest = { ...request, renderer: scene.renderer };
    try {
      await this.#open(again, signal, false, () => undefined);
    } catch {
      if (!signal.aborted && this.#scene !== scene) await this.#attempt(again, signal, false, () => undefined);
    }
  }

  /** Brings the scene back, unnoticed but for a pair of events, after its device was lost. */
  async #restore(request: SceneRequest, loss: GPUDeviceLostInfo): Promise<void> {
    const signal = this.#running.renew();
    this.#submissions = Math.min(MOST_SUBMISSIONS, SUBMISSIONS_GROWTH * this.#submissions);
    this.#drop(false);
    if (!this.#isContextLost) this.#of.contextChanged('contextlost');
    this.#isContextLost = true;
    await pageVisible(signal);
    if (!signal.aborted) await this.#attempt(request, signal, false, () => undefined, loss);
    if (signal.aborted || this.#scene === null) return;
    this.#tellRestored();
    void this.#refine();
  }

  /** No device comes, or none stays. The scene is loaded again once there is one, if it may be and nothing else is asked for. */
  async #giveUp(request: SceneRequest, { signal: given, error, loss, mayReturn }: GivenUp): Promise<void> {
    try {
      const { deviceBack, unrecoverable } = await loadModule(
        'the code for lost devices',
        () => import('../gpu/come-back.js'),
      );
      if (given.aborted) return;
      this.fail(unrecoverable(error, loss), this.isOutgoing);
      if (mayReturn) void this.#comeBack(request, deviceBack);
    } catch (missing) {
      if (!given.aborted) this.fail(missing);
    }
  }

  async #comeBack(request: SceneRequest, deviceBack: DeviceBack): Promise<void> {
    const lease = await deviceBack(this.#of.services.sharedDevice, this.#running.signal);
    if (lease === undefined) return;
    this.#error = null;
    await this.#load(request).finally(() => lease.release());
  }

  #tellRestored(): void {
    if (!this.#isContextLost) return;
    this.#isContextLost = false;
    this.#of.contextChanged('contextrestored');
  }

  /** Opens and shows a scene, again if the device is lost meanwhile. Afterwards there is a scene, or an error. */
  async #attempt(
    request: SceneRequest,
    signal: AbortSignal,
    isNew: boolean,
    onProgress: ProgressListener,
    loss?: GPUDeviceLostInfo,
  ): Promise<void> {
    for (let failures = 0; ;) {
      try {
        return await this.#open(request, signal, isNew, onProgress);
      } catch (error) {
        if (signal.aborted) return;
        if (!isDeviceFailure(error, isNew)) return this.fail(error);
        if (error instanceof DeviceLostError) loss = error.info;
        this.#submissions = Math.min(MOST_SUBMISSIONS, SUBMISSIONS_GROWTH * this.#submissions);
        this.#drop(false);
        if (++failures >= MAX_FAILURES) {
          // A scene that has been shown is loaded once more, some seconds later; as a new one it then gets no other chance.
          return this.#giveUp(request, { signal, error, loss, mayReturn: !isNew });
        }
        await delay(RETRY_DELAY_MS);
        if (signal.aborted) return;
      }
    }
  }

  async #open(request: SceneRequest, signal: AbortSignal, isNew: boolean, onProgress: ProgressListener): Promise<void> {
    const { services, memoryBudget, wantsPreviews } = this.#of;
    const onPreview = isNew && wantsPreviews ? (preview: LoadedGaussians) => this.#showPreview(preview) : undefined;
    const beforeUpload = (byteLength: number): void => {
      if (signal.aborted) return;
      const isSmall = this.isPreview && byteLength >= MIN_GROWTH * (this.#scene?.gaussians.byteLength ?? 0);
      // A small preview stays on show meanwhile.
      if (!isSmall) this.#drop(false);
    };
    this.#setReleasable(true);
    const scene = await openScene(request, {
      open: this.#of.open,
      device: services.sharedDevice,
      loader: services.sceneLoader,
      frameUrl: (url) => this.#of.services.urlModifier?.(url) ?? url,
      live: () => this.#of.liveRequest,
      ...{ signal, onProgress, onPreview, beforeUpload, memoryBudget, submissions: this.#submissions },
    }).finally(() => this.#setReleasable(false));
    if (signal.aborted) return scene.destroy();
    const entrance = !isNew ? 'again' : this.#isPreview ? 'whole' : 'new';
    this.#replace(scene, false);
    await Promise.race([this.#of.show(scene, entrance), scene.lost]);
    if (signal.aborted) return;
    if (scene.isLost) throw new DeviceLostError(await scene.lost);
    this.#host.requestUpdate();
    void scene.lost.then((loss) => {
      if (this.#scene !== scene) return;
      // What will take its place has its own way back.
      if (this.isOutgoing) this.#drop(false);
      // What comes back is drawn by what has drawn it.
      else void this.#restore({ ...(this.#request ?? request), renderer: scene.renderer }, loss);
    });
  }

  #showPreview(preview: LoadedGaussians): void {
    const entrance = this.#isPreview ? 'whole' : 'new';
    this.#replace(preview, true);
    void this.#of.show(preview, entrance).then(
      () => this.#scene === preview && this.#of.previewShown(preview),
      // The whole scene will say what is wrong.
      () => undefined,
    );
    this.#host.requestUpdate();
  }

  /** Another scene in place of the one on show, whose picture stays until the first of the new one. */
  #replace(scene: LoadedGaussians, isPreview: boolean): void {
    this.#drop(false);
    this.#scene = scene;
    this.#isAway = false;
    this.#shownRequest = this.#request;
    this.#isPreview = isPreview;
    this.#setReleasable(isPreview);
  }

  #clear(): void {
    this.#running.renew();
    this.#request = null;
    this.#isAway = false;
    this.#drop(true);
    this.#error = null;
    this.#setState('empty');
    this.#of.emptied();
  }

  /** Whether the scene on show may be dropped where others lack its memory: the element is gone, or another scene is to take its place. */
  #setReleasable(isSpare: boolean): void {
    if (this.#scene === null) return;
    const { releasable } = this.#scene.place.memory;
    // What a generator has come to is not to be had again.
    const isUnseen = this.#isUnseen && this.#state === 'ready' && !this.#scene.live;
    if (isSpare || this.#releaseTimer || isUnseen)
      releasable.set(this.#giveBack, isUnseen ? this.#scene.gaussians.byteLength : 0);
    else releasable.delete(this.#giveBack);
  }

  readonly #giveBack = (): void => {
    if (this.#releaseTimer) return this.#clear();
    this.#isAway = this.#isUnseen === true && this.#state === 'ready';
    this.#drop(false);
  };

  #drop(clear: boolean): void {
    if (this.#scene !== null || clear) this.#of.hide(clear);
    if (this.#scene === null) return;
    this.#scene.place.memory.releasable.delete(this.#giveBack);
    this.#scene.destroy();
    this.#scene = null;
  }

  #setState(state: SceneState): void {
    this.#state = state;
    if (state !== 'loading') this.#isPreview = false;
    this.#host.requestUpdate();
    if (state === 'waiting' || state === 'loading') return;
    const waiters = this.#waiters;
    this.#waiters = [];
    for (const resolve of waiters) resolve();
  }
}

const isSame = (a: SceneRequest, b: SceneRequest | null): boolean =>
  a.url === b?.url &&
  a.credentials === b.credentials &&
  a.renderer === b.renderer &&
  isSameContract(a.contract, b.contract) &&
  (a.chain ?? []).join(' ') === (b.chain ?? []).join(' ');
