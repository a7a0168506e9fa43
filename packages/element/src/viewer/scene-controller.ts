import { loadModule } from '@gaussian-splat/core';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { toElementError, type ElementError } from './errors.js';
import type * as comeBack from '../gpu/device-recovery.js';
import { delay, DeviceLostError, isDeviceFailure, pageVisible } from '../gpu/device-failures.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { openScene } from '../gpu/open-scene.js';
import type { ProgressListener, SceneRequest } from '../loading/protocol.js';
import type { OpenOptions } from '../sources/source-kind.js';
import { kindOf } from '../sources/source-kinds.js';
import { LatestTask } from './latest-task.js';
import { isSameContract } from '../loading/same-contract.js';
import type { Services } from './element-host.js';
import { timerMs } from './attribute.js';
import { Renewals } from './renewals.js';

/**
 * State of the requested scene. `empty`: no scene is requested. `waiting`: loading may not start yet, for example
 * because the element has not entered the viewport.
 */
export type SceneState = 'empty' | 'waiting' | 'loading' | 'ready' | 'failed';

/**
 * Reason for which a scene is shown: it is `new`, it replaces its preview (`whole`), or it is loaded `again`, for
 * example after the device was lost.
 */
export type Entrance = 'new' | 'whole' | 'again';

/** Interface of the element for the controller of its scene. */
export interface SceneHost {
  readonly services: Services;
  /** `wantsPreviews`: whether a preview would be visible while a scene loads. */
  readonly core: { readonly wantsPreviews: boolean } | undefined;
  /** Maximum GPU memory of the scene, in bytes; undefined if only the device limits it. */
  readonly memoryBudget: number | undefined;
  /** Parameters for opening a generator that the element provides, not the request: see {@link OpenOptions.live}. */
  readonly dynamicRequest: ReturnType<OpenOptions['live']>;
  /** Shows a scene. Resolves when its first frame is drawn. */
  show(scene: LoadedGaussians, entrance: Entrance): Promise<void>;
  /** Called before the current scene is destroyed. If `clear` is true, its last frame must disappear, too. */
  hide(clear: boolean): void;
  /** Called when the first frame of a preview is drawn. */
  previewShown(preview: LoadedGaussians): void;
  loadStarted(): void;
  progressed(...progress: Parameters<ProgressListener>): void;
  loaded(url: string): void;
  /** Called when the scene is removed, has failed, or is to be replaced by another. */
  emptied(): void;
  failed(error: ElementError): void;
  contextChanged(event: 'contextlost' | 'contextrestored'): void;
}

type DeviceBack = (typeof comeBack)['waitForDevice'];

/** Why an attempt to open a scene has ended without a device. */
interface GivenUp {
  readonly signal: AbortSignal;
  readonly error: unknown;
  readonly loss: GPUDeviceLostInfo | undefined;
  readonly mayReturn: boolean;
}

/** Number of failed attempts after which no more devices are requested for a scene. */
const MAX_FAILURES = 2;
/** Delay of the second attempt, ms, because a crashed GPU process needs time to restart. */
const RETRY_DELAY_MS = 1_000;

/**
 * Minimum ratio of the GPU memory of the complete scene to that of its preview for keeping the preview during the
 * upload, because both take memory then.
 */
const MIN_GROWTH = 4;

/**
 * Factor by which the number of submissions of a frame grows after each loss of the device, and the maximum number. It
 * does not affect the image.
 */
const SUBMISSIONS_GROWTH = 4;
const MAX_SUBMISSIONS = 64;

/** Number of sources of the page until now. */
let sources = 0;

/**
 * Controls the life cycle of the element's scene: loads it, replaces it (the latest request wins), recovers after the
 * loss of the device, and releases it. Work for an older request finds its signal aborted and has no effect.
 */
export class SceneController implements ReactiveController {
  readonly #host: ReactiveControllerHost;
  readonly #of: SceneHost;
  #state: SceneState = 'empty';
  #error: ElementError | null = null;
  #scene: LoadedGaussians | null = null;
  #isPreview = false;
  /** Request for which the current scene was loaded. */
  #shownRequest: SceneRequest | null = null;
  #request: SceneRequest | null = null;
  readonly #running = new LatestTask();
  #releaseTimer: ReturnType<typeof setTimeout> | undefined;
  #waiters: (() => void)[] = [];
  /** Whether the scene is outside the viewport; undefined until it has been in the viewport. */
  #isUnseen: boolean | undefined;
  /** Whether the scene was released off-screen, and must be reloaded when it is visible. */
  #isAway = false;
  /** Resolves when the last load by {@link present} has ended; undefined before the first. */
  #presented: Promise<void> | undefined;
  /** Whether `contextlost` was reported without `contextrestored`. Another scene may end this state. */
  #isContextLost = false;
  /**
   * Number of submissions of a frame. It grows with each loss of the device, because a submission that ran too long for
   * the driver may have been the cause.
   */
  #submissions = 1;
  /** Number of this source for {@link SceneRequest.source}. */
  readonly #source = ++sources;
  readonly #renewals = new Renewals();

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

  /** Absolute address of the last request; empty without one. */
  get url(): string {
    return this.#request?.url ?? '';
  }

  /** The request of the current scene; null without a scene, and for a preview. */
  get shownRequest(): SceneRequest | null {
    return this.#scene && !this.isPreview ? this.#shownRequest : null;
  }

  /** The current scene, which may be a preview or a scene that will be replaced; null without one. */
  get scene(): LoadedGaussians | null {
    return this.#scene;
  }

  /** Whether the current scene is a preview of the one that is being loaded. */
  get isPreview(): boolean {
    return this.#isPreview && this.#scene !== null;
  }

  /** Whether a newer request will replace the current scene. */
  get isOutgoing(): boolean {
    return this.#shownRequest !== this.#request;
  }

  /** Resolves when the requested scene is shown, has failed or was abandoned; at once if none is. Never rejects. */
  get settled(): Promise<void> {
    if (this.#state !== 'waiting' && this.#state !== 'loading') return Promise.resolve();
    return new Promise((resolve) => this.#waiters.push(resolve));
  }

  /** Returns whether a request, null for none, is for another scene than the last, or other arrays than failed ones. */
  isOther(request: SceneRequest | null): boolean {
    if (this.#error && request?.splats !== this.#request?.splats) return true;
    return request === null ? this.#request !== null : !isSame(request, this.#request);
  }

  /**
   * Sets the scene to show; null for none. May be called at any rate: only changes have an effect.
   * @param mayStart Whether loading may start; false while a lazy element is off-screen.
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

  /**
   * Call when the scene enters or leaves the viewport. A scene that has left the viewport may be released to free
   * memory. It is reloaded without events when it enters the viewport again.
   */
  see(isSeen: boolean): void {
    if (!isSeen && this.#isUnseen === undefined) return;
    this.#isUnseen = !isSeen;
    if (isSeen) void this.present();
    this.#setReleasable(false);
  }

  /** Loads the scene again if it was released off-screen. Resolves when the scene is shown or has failed. */
  async present(): Promise<void> {
    if (this.#isAway) this.#presented = this.#attempt(this.#request!, this.#running.renew(), false, () => undefined);
    this.#isAway = false;
    await this.#presented;
  }

  /**
   * Loads the file of the current scene again, which was replaced on its server. The current scene stays until the new one
   * is loaded, and the clock continues. Rejects if that fails, and with `error` if the file is replaced too often.
   */
  async renew(error: unknown): Promise<void> {
    const [request, scene] = [this.#request, this.#scene];
    if (this.#state === 'ready' && request && scene && !this.isOutgoing)
      await this.#renewals.run(error, () => this.#openAgain(request, scene));
  }

  /**
   * Stops with an error, because the scene cannot be loaded or drawn.
   * @param clear Whether the last frame is removed.
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
    this.#notifyRestored();
    void this.#refine();
  }

  /**
   * Reloads the same scene with the requested precision of its color coefficients. The current scene stays until the
   * new one is loaded, and if loading fails.
   */
  async #refine(): Promise<void> {
    const [request, scene] = [this.#request, this.#scene];
    if (this.#state !== 'ready' || request === null || scene === null || scene.live) return;
    if (kindOf(request).name !== 'file') return;
    const { shPrecision, shDegree } = scene.gaussians;
    if (request.sh === 'auto' || request.sh === shPrecision || shDegree === 0) return;
    await this.#openAgain(request, scene).catch(() => undefined);
  }

  /** Loads a scene in place of the current one. Rejects if that fails and the current one is still there. */
  async #openAgain(request: SceneRequest, current: LoadedGaussians): Promise<void> {
    const signal = this.#running.renew();
    const again: SceneRequest = { ...request, renderer: current.renderer };
    try {
      await this.#open(again, signal, false, () => undefined);
    } catch (error) {
      if (signal.aborted) return;
      if (this.#scene === current) throw error;
      await this.#attempt(again, signal, false, () => undefined);
    }
  }

  /** Reloads the scene after its device was lost. The only events are `contextlost` and `contextrestored`. */
  async #restore(request: SceneRequest, loss: GPUDeviceLostInfo): Promise<void> {
    const signal = this.#running.renew();
    this.#submissions = Math.min(MAX_SUBMISSIONS, SUBMISSIONS_GROWTH * this.#submissions);
    this.#drop(false);
    if (!this.#isContextLost) this.#of.contextChanged('contextlost');
    this.#isContextLost = true;
    await pageVisible(signal);
    if (!signal.aborted) await this.#attempt(request, signal, false, () => undefined, loss);
    if (signal.aborted || this.#scene === null) return;
    this.#notifyRestored();
    void this.#refine();
  }

  /**
   * Fails because no device is available, or none lasts. If `mayReturn` is true and nothing else is requested, the
   * scene is loaded again when a device is available.
   */
  async #giveUp(request: SceneRequest, { signal: given, error, loss, mayReturn }: GivenUp): Promise<void> {
    try {
      const { waitForDevice, unrecoverable } = await loadModule(
        'the code for lost devices',
        () => import('../gpu/device-recovery.js'),
      );
      if (given.aborted) return;
      this.fail(unrecoverable(error, loss), this.isOutgoing);
      if (mayReturn) void this.#comeBack(request, waitForDevice);
    } catch (missing) {
      if (!given.aborted) this.fail(missing);
    }
  }

  async #comeBack(request: SceneRequest, waitForDevice: DeviceBack): Promise<void> {
    const lease = await waitForDevice(this.#of.services.sharedDevice, this.#running.signal);
    if (lease === undefined) return;
    this.#error = null;
    await this.#load(request).finally(() => lease.release());
  }

  #notifyRestored(): void {
    if (!this.#isContextLost) return;
    this.#isContextLost = false;
    this.#of.contextChanged('contextrestored');
  }

  /**
   * Opens and shows a scene; tries again if the device is lost before it is shown. Afterwards there is a scene or an
   * error, unless the signal is aborted.
   */
  async #attempt(
    request: SceneRequest,
    signal: AbortSignal,
    isNew: boolean,
    onProgress: ProgressListener,
    loss?: GPUDeviceLostInfo,
  ): Promise<void> {
    for (let failures = 0; ;) {
      try {
        return await this.#open(request, signal, isNew, onProgress, failures);
      } catch (error) {
        if (signal.aborted) return;
        if (!isDeviceFailure(error, isNew)) return this.fail(error);
        if (error instanceof DeviceLostError) loss = error.info;
        this.#submissions = Math.min(MAX_SUBMISSIONS, SUBMISSIONS_GROWTH * this.#submissions);
        this.#drop(false);
        if (++failures >= MAX_FAILURES) {
          // A scene that has been shown before is loaded once more, some seconds later. That load counts as new, so it
          // is not repeated.
          return this.#giveUp(request, { signal, error, loss, mayReturn: !isNew });
        }
        await delay(RETRY_DELAY_MS);
        if (signal.aborted) return;
      }
    }
  }

  async #open(
    request: SceneRequest,
    signal: AbortSignal,
    isNew: boolean,
    onProgress: ProgressListener,
    losses = 0,
  ): Promise<void> {
    const { services, memoryBudget, core } = this.#of;
    const onPreview =
      isNew && core!.wantsPreviews ? (preview: LoadedGaussians) => this.#showPreview(preview) : undefined;
    const beforeUpload = (byteLength: number): void => {
      // The file of a renewal may be replaced again, so that the current scene stays until the new one is loaded.
      if (signal.aborted || this.#renewals.isRunning) return;
      const isSmall = this.isPreview && byteLength >= MIN_GROWTH * (this.#scene?.gaussians.byteLength ?? 0);
      // A small preview stays until the complete scene replaces it.
      if (!isSmall) this.#drop(false);
    };
    this.#setReleasable(true);
    request = { ...request, source: this.#source };
    const scene = await openScene(request, {
      device: services.sharedDevice,
      loader: services.sceneLoader,
      frameUrl: (url) => this.#of.services.urlModifier?.(url) ?? url,
      live: () => this.#of.dynamicRequest,
      ...{ signal, onProgress, onPreview, beforeUpload, memoryBudget, submissions: this.#submissions, losses },
    }).finally(() => this.#setReleasable(false));
    if (signal.aborted) return scene.destroy();
    const entrance = !isNew ? 'again' : this.#isPreview ? 'whole' : 'new';
    this.#replace(scene, false);
    await Promise.race([this.#of.show(scene, entrance), scene.place.lost]);
    if (signal.aborted) return;
    if (scene.place.isLost) throw new DeviceLostError(await scene.place.lost);
    this.#host.requestUpdate();
    void scene.place.lost.then((loss) => {
      if (this.#scene !== scene) return;
      // If another scene will replace this one, the load of that scene recovers on its own.
      if (this.isOutgoing) this.#drop(false);
      // The recovered scene uses the same renderer as before.
      else void this.#restore({ ...(this.#request ?? request), renderer: scene.renderer }, loss);
    });
  }

  #showPreview(preview: LoadedGaussians): void {
    const entrance = this.#isPreview ? 'whole' : 'new';
    this.#replace(preview, true);
    void this.#of.show(preview, entrance).then(
      () => this.#scene === preview && this.#of.previewShown(preview),
      // The load of the complete scene will report the error.
      () => undefined,
    );
    this.#host.requestUpdate();
  }

  /** Replaces the current scene. Its last frame stays until the first frame of the new scene. */
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

  /**
   * Sets whether the current scene may be released if other scenes need its memory. This is always allowed while the
   * element is removed, and while a scene without a generator is off-screen.
   */
  #setReleasable(isReleasable: boolean): void {
    if (this.#scene === null) return;
    const { releasable } = this.#scene.place.memory;
    // A generator is not released, because its state cannot be restored.
    const isUnseen = this.#isUnseen && this.#state === 'ready' && !this.#scene.live;
    if (isReleasable || this.#releaseTimer || isUnseen)
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
  a.groups === b.groups &&
  isSameContract(a.contract, b.contract) &&
  (a.chain ?? []).join(' ') === (b.chain ?? []).join(' ');
