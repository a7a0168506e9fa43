import { loadModule } from '@gaussian-splat/core';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import { toElementError, type ElementError } from '../errors.js';
import type * as comeBack from '../gpu/device-recovery.js';
import { delay, DeviceLostError, isDeviceFailure, pageVisible } from '../gpu/device-failures.js';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import { isStreamed, openScene, type openGaussians, type OpenOptions } from '../gpu/open-scene.js';
import type { ProgressListener, SceneRequest } from '../loading/protocol.js';
import { LatestTask } from '../latest-task.js';
import { isSameContract } from '../loading/same-contract.js';
import type { Services } from '../element-host.js';
import { timerMs } from '../attributes.js';

/** `waiting`: there is a scene to load, but the element has not entered the viewport yet. */
export type SceneState = 'empty' | 'waiting' | 'loading' | 'ready' | 'failed';

/** How a scene is shown: as a `new` one, replacing its preview (`whole`), or `again` after a lost device. */
export type Entrance = 'new' | 'whole' | 'again';

/** Interface of the element for the controller. */
export interface SceneHost {
  readonly services: Services;
  /** Whether a preview would be visible while a scene loads. */
  readonly wantsPreviews: boolean;
  /** Upper limit of the scene's GPU memory in bytes. */
  readonly memoryBudget: number | undefined;
  /** Additional data of a request for a generator. */
  readonly dynamicRequest: ReturnType<OpenOptions['live']>;
  /** Opens sources other than scenes of splats. */
  readonly open?: typeof openGaussians;
  /** Shows a scene; resolves once its first frame is drawn. */
  show(scene: LoadedGaussians, entrance: Entrance): Promise<void>;
  /** Called before the current scene is destroyed; `clear` also removes its frame. */
  hide(clear: boolean): void;
  /** Called when a preview of the scene is shown. */
  previewShown(preview: LoadedGaussians): void;
  loadStarted(): void;
  progressed(...progress: Parameters<ProgressListener>): void;
  loaded(url: string): void;
  /** Called when there is no scene any more, or another replaces it. */
  emptied(): void;
  failed(error: ElementError): void;
  contextChanged(event: 'contextlost' | 'contextrestored'): void;
}

type DeviceBack = (typeof comeBack)['waitForDevice'];

/** The state when no more devices are requested. */
interface GivenUp {
  readonly signal: AbortSignal;
  readonly error: unknown;
  readonly loss: GPUDeviceLostInfo | undefined;
  readonly mayReturn: boolean;
}

/** Number of consecutive failed recoveries after which the loss is final. */
const MAX_FAILURES = 2;
/** Pause before the second try, ms, because a crashed GPU process needs time to restart. */
const RETRY_DELAY_MS = 1_000;

/**
 * A preview stays during the upload of the whole scene if that is larger by this factor, because both take memory then.
 */
const MIN_GROWTH = 4;

/** Growth of the number of submissions of a frame after each loss, and its maximum: the image does not change. */
const SUBMISSIONS_GROWTH = 4;
const MAX_SUBMISSIONS = 64;

/**
 * Life cycle of the element's scene: load, replace (the latest request wins), recover after the loss of the device,
 * release. Work for an older request finds its signal aborted and has no effect.
 */
export class SceneController implements ReactiveController {
  readonly #host: ReactiveControllerHost;
  readonly #of: SceneHost;
  #state: SceneState = 'empty';
  #error: ElementError | null = null;
  #scene: LoadedGaussians | null = null;
  #isPreview = false;
  /** Request of the current scene. */
  #shownRequest: SceneRequest | null = null;
  #request: SceneRequest | null = null;
  readonly #running = new LatestTask();
  #releaseTimer: ReturnType<typeof setTimeout> | undefined;
  #waiters: (() => void)[] = [];
  /** Undefined until it has been in the viewport. */
  #isUnseen: boolean | undefined;
  /** Whether it was released off-screen, and is to be reloaded. */
  #isAway = false;
  /** Whether a reported loss is still unresolved; another scene may resolve it. */
  #isContextLost = false;
  /** Grows with every loss of the device, because a frame that ran too long for the driver may have been the cause. */
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

  /** Absolute address of the last request; empty for none. */
  get url(): string {
    return this.#request?.url ?? '';
  }

  /** The request of the current scene; null without one. */
  get shownRequest(): SceneRequest | null {
    return this.#scene && !this.isPreview ? this.#shownRequest : null;
  }

  /** The current scene. */
  get scene(): LoadedGaussians | null {
    return this.#scene;
  }

  /** Whether the current scene is a preview of the one that is being loaded. */
  get isPreview(): boolean {
    return this.#isPreview && this.#scene !== null;
  }

  /** Whether another scene will replace the current one. */
  get isOutgoing(): boolean {
    return this.#shownRequest !== this.#request;
  }

  /** Resolves, and never rejects, once nothing is pending: shown, failed or abandoned. */
  get settled(): Promise<void> {
    if (this.#state !== 'waiting' && this.#state !== 'loading') return Promise.resolve();
    return new Promise((resolve) => this.#waiters.push(resolve));
  }

  /** Whether a request, null for none, is for another scene than the last one. */
  isOther(request: SceneRequest | null): boolean {
    return request === null ? this.#request !== null : !isSame(request, this.#request);
  }

  /**
   * Sets the scene to show, or null for none. May be called at any rate: only changes have an effect.
   * @param mayStart False while a lazy element is off-screen.
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
   * Reports whether the scene is in the viewport. One that has left it may be released; it is reloaded in the viewport
   * without events.
   */
  see(isSeen: boolean): void {
    if (!isSeen && this.#isUnseen === undefined) return;
    this.#isUnseen = !isSeen;
    if (isSeen) void this.present();
    this.#setReleasable(false);
  }

  /** Loads the scene again if it was released out of view. */
  async present(): Promise<void> {
    if (!this.#isAway) return;
    this.#isAway = false;
    await this.#attempt(this.#request!, this.#running.renew(), false, () => undefined);
  }

  /**
   * Stops with an error: the scene cannot be drawn.
   * @param clear False keeps the last frame.
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
   * Reloads the same scene with the requested color precision. The current one stays until it is loaded, or if that
   * fails.
   */
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

  /** Reloads the scene after its device was lost, with only a pair of events. */
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
   * No device is available, or none lasts. The scene is loaded again once there is one, if allowed and nothing else was
   * requested.
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
        this.#submissions = Math.min(MAX_SUBMISSIONS, SUBMISSIONS_GROWTH * this.#submissions);
        this.#drop(false);
        if (++failures >= MAX_FAILURES) {
          // A scene that has been shown is loaded once more, some seconds later; as a new one it then gets no other
          // chance.
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
      // A small preview stays meanwhile.
      if (!isSmall) this.#drop(false);
    };
    this.#setReleasable(true);
    const scene = await openScene(request, {
      open: this.#of.open,
      device: services.sharedDevice,
      loader: services.sceneLoader,
      frameUrl: (url) => this.#of.services.urlModifier?.(url) ?? url,
      live: () => this.#of.dynamicRequest,
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
      // The scene that replaces it recovers on its own.
      if (this.isOutgoing) this.#drop(false);
      // A recovered scene uses the same backend as before.
      else void this.#restore({ ...(this.#request ?? request), renderer: scene.renderer }, loss);
    });
  }

  #showPreview(preview: LoadedGaussians): void {
    const entrance = this.#isPreview ? 'whole' : 'new';
    this.#replace(preview, true);
    void this.#of.show(preview, entrance).then(
      () => this.#scene === preview && this.#of.previewShown(preview),
      // The whole scene will report the error.
      () => undefined,
    );
    this.#host.requestUpdate();
  }

  /** Replaces the current scene, whose frame stays until the first of the new one. */
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
   * Whether the current scene may be released if others need its memory: the element is gone, or another scene is to
   * replace it.
   */
  #setReleasable(isReleasable: boolean): void {
    if (this.#scene === null) return;
    const { releasable } = this.#scene.place.memory;
    // The state of a generator cannot be restored.
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
  isSameContract(a.contract, b.contract) &&
  (a.chain ?? []).join(' ') === (b.chain ?? []).join(' ');
