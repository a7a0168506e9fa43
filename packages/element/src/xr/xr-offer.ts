import { GaussianSplatError } from '@gaussian-splat/core';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { XrHost } from './xr-host.js';
import type { ExtraWord } from '../words.js';
import { contextFor, openXrScene, unsupported, type XrContext, type XrScene } from './xr-scene.js';
import { XrLoop, type XrGuide } from './xr-session.js';
import { xrOf, type XrMode, type XrSession, type XrSpace } from './webxr.js';

export type XrStatus = 'not-presenting' | 'session-started' | 'object-placed' | 'failed';

/** Definition of a kind of session. */
export interface XrKind {
  readonly mode: XrMode;
  /** Name of the attribute, of its button's slot, and of its status. */
  readonly name: 'vr' | 'ar';
  readonly word: ExtraWord;
  /** Whether the page enables it. */
  readonly isWanted: () => boolean;
  /** For `requestSession`; called in the click. */
  options(): object;
  /** Reference spaces, the best first. */
  readonly spaces: readonly string[];
  guide(started: XrStarted): XrGuide;
}

export interface XrStarted {
  readonly session: XrSession;
  readonly space: XrSpace;
  readonly spaceType: string;
  readonly gl: WebGL2RenderingContext;
  /** Aborted when the session ends. */
  readonly signal: AbortSignal;
  readonly offer: XrOffer;
}

/** A running session. */
interface Running {
  readonly session: XrSession;
  readonly over: AbortController;
  readonly shown: LoadedGaussians | null;
  context?: XrContext;
  loop?: XrLoop;
  scene?: XrScene;
}

/** Offers one kind of session: a button if sessions are supported, the session itself, and its status. */
export class XrOffer implements ReactiveController {
  readonly core: XrHost;
  readonly kind: XrKind;
  readonly #element: ReactiveControllerHost & HTMLElement;
  readonly #slot: HTMLSlotElement;
  readonly #button: HTMLButtonElement;
  readonly #place: HTMLElement;
  #isSupported = false;
  #isStarting = false;
  #running: Running | undefined;
  #watching: AbortController | undefined;
  #isWarned = false;

  constructor(element: ReactiveControllerHost & HTMLElement, core: XrHost, place: HTMLElement, kind: XrKind) {
    this.#element = element;
    this.core = core;
    this.kind = kind;
    this.#place = place;
    const { ownerDocument: page } = element;
    this.#slot = Object.assign(page.createElement('slot'), { name: `${kind.name}-button` });
    this.#button = Object.assign(page.createElement('button'), { type: 'button' });
    this.#button.setAttribute('part', `${kind.name}-button`);
    this.#slot.append(this.#button);
    // Also handles the author's button in the slot.
    this.#slot.addEventListener('click', () => {
      this.activate().catch((error: Error) => core.warn(error.message));
    });
    element.addController(this);
  }

  /** Whether a session could start now. */
  get canActivate(): boolean {
    return this.#isSupported && this.kind.isWanted() && this.core.walkable !== null;
  }

  get isPresenting(): boolean {
    return this.#running !== undefined;
  }

  /** Draws the session; undefined outside one. */
  get loop(): XrLoop | undefined {
    return this.#running?.loop;
  }

  hostConnected(): void {
    this.hostUpdated();
  }

  hostUpdated(): void {
    const { isConnected } = this.#element;
    if (isConnected && this.kind.isWanted()) this.#watch();
    else this.hostDisconnected();
    const { strings } = this.core;
    this.#button.textContent = strings[this.kind.word] ?? WORDS[this.kind.word];
    if (Object.keys(strings).length === 0) this.#button.lang = 'en';
    else this.#button.removeAttribute('lang');
    if (!this.canActivate || this.isPresenting) this.#slot.remove();
    else if (!this.#slot.isConnected) this.#place.append(this.#slot);
    if (this.#running && this.#isOutdated(this.#running)) this.end();
  }

  /**
   * The session ends if another source is requested, which does not load out of view, or if the page's splats, which it
   * draws, are gone.
   */
  #isOutdated({ context, shown }: Running): boolean {
    const { scene } = this.core.sources.ownEntry;
    return scene.isOutgoing || (context?.isOwn === false && scene.scene !== shown);
  }

  hostDisconnected(): void {
    this.#watching?.abort();
    this.#watching = undefined;
    this.#isSupported = false;
    this.#slot.remove();
    this.end();
  }

  /**
   * Starts a session. Calls the browser without an earlier await, so call it in a click handler.
   * @throws GaussianSplatError `unsupported/xr` if it is not available, `argument/activation` outside a click
   */
  activate(): Promise<void> {
    const xr = xrOf(this.#element.ownerDocument.defaultView);
    if (!xr || !this.canActivate) return Promise.reject(unsupported('a headset or a phone, and a scene file', 'none'));
    if (this.#isStarting || this.#running) return Promise.resolve();
    this.#isStarting = true;
    return xr
      .requestSession(this.kind.mode, this.kind.options())
      .then(
        (session) => this.#start(session),
        (error: unknown) => {
          throw refused(error);
        },
      )
      .catch((error: unknown) => {
        this.status('failed', (error as Error).message);
        throw error;
      })
      .finally(() => (this.#isStarting = false));
  }

  end(): void {
    this.#running?.session.end().catch(() => undefined);
  }

  /** Reports the status to the page and to CSS. */
  status(status: XrStatus, reason?: string): void {
    const name = `${this.kind.name}-status` as const;
    this.#element.setAttribute(name, status);
    this.#element.dispatchEvent(new CustomEvent(name, { detail: { status, ...(reason && { reason }) } }));
  }

  async #start(session: XrSession): Promise<void> {
    const { core } = this;
    const running: Running = { session, over: new AbortController(), shown: core.sources.ownEntry.scene.scene };
    this.#running = running;
    session.addEventListener('end', () => this.#ended(running), { once: true });
    core.reveal.dismiss();
    core.isImmersed = true;
    this.#element.requestUpdate();
    this.status('session-started');
    try {
      await this.#open(running);
    } catch (error) {
      if (running.over.signal.aborted) return;
      this.status('failed', (error as Error).message);
      this.end();
      throw error;
    }
  }

  async #open(running: Running): Promise<void> {
    const { core, kind } = this;
    const { session, over, shown } = running;
    const { signal } = over;
    const request = core.walkable;
    if (request === null) throw unsupported('a scene that has loaded', 'none');
    const context = (running.context = await contextFor(shown));
    if (signal.aborted) return this.#free(running);
    context.gl.canvas.addEventListener('webglcontextlost', () => this.#lost(running), { signal });
    const [spaceType, space] = await spaceOf(session, kind.spaces);
    if (signal.aborted) return;
    const guide = kind.guide({ ...{ session, space, spaceType, signal }, gl: context.gl, offer: this });
    running.loop = new XrLoop(session, context, space, guide);
    const { sceneLoader: loader } = core.services;
    const scene = await openXrScene(context, { shown, request, loader }, signal);
    running.scene = scene;
    if (signal.aborted) return this.#free(running);
    const { maxShDegree: shDegree, filter, order } = core.attributes;
    running.loop.show(scene, {
      shDegree,
      filter: filter === 'auto' ? undefined : filter,
      byDistance: order === 'distance',
      spawn: loader.spawn,
    });
  }

  #lost(running: Running): void {
    if (running !== this.#running) return;
    this.status('failed', 'the WebGL context was lost');
    this.end();
  }

  #ended(running: Running): void {
    running.over.abort(new DOMException('the session is over', 'AbortError'));
    this.#free(running);
    this.#running = undefined;
    this.core.isImmersed = false;
    if (this.#element.getAttribute(`${this.kind.name}-status`) !== 'failed') this.status('not-presenting');
    this.core.requestFrame();
    this.#element.requestUpdate();
  }

  #free(running: Running): void {
    running.loop?.stop();
    running.scene?.destroy();
    running.scene = undefined;
    if (running.context?.isOwn) running.context.gl.getExtension('WEBGL_lose_context')?.loseContext();
    running.context = undefined;
  }

  #watch(): void {
    const xr = xrOf(this.#element.ownerDocument.defaultView);
    if (this.#watching || !xr) return;
    this.#watching = new AbortController();
    const { signal } = this.#watching;
    const look = (): void => {
      xr.isSessionSupported(this.kind.mode).then(
        (isSupported) => !signal.aborted && this.#setSupported(isSupported),
        (error: Error) => !signal.aborted && this.#refusedBy(error),
      );
    };
    xr.addEventListener?.('devicechange', look, { signal });
    look();
  }

  #setSupported(isSupported: boolean): void {
    this.#isSupported = isSupported;
    if (isSupported && !this.#element.hasAttribute(`${this.kind.name}-status`)) this.status('not-presenting');
    this.#element.requestUpdate();
  }

  #refusedBy({ name }: Error): void {
    this.#setSupported(false);
    if (this.#isWarned || name !== 'SecurityError') return;
    this.#isWarned = true;
    this.core.warn(
      `<gaussian-splat> ${this.kind.name}: this frame may not use WebXR. The page around it allows that by <iframe allow="xr-spatial-tracking; gamepad">.`,
    );
  }
}

export const WORDS: Readonly<Record<ExtraWord, string>> = {
  vr: 'View in VR',
  ar: 'View in your room',
  'ar-simplified': 'View a simplified model in AR',
  'exit-ar': 'Leave AR',
  measure: 'Measure',
  'measure-keys': 'Press Enter to set each end of the ruler; the arrow keys turn the view. Escape puts the ruler away.',
  'measure-none': 'No surface here',
};

async function spaceOf(session: XrSession, types: readonly string[]): Promise<[string, XrSpace]> {
  for (const type of types.slice(0, -1)) {
    const space = await session.requestReferenceSpace(type).catch(() => undefined);
    if (space) return [type, space];
  }
  const last = types[types.length - 1];
  return [last, await session.requestReferenceSpace(last)];
}

function refused(error: unknown): GaussianSplatError {
  const { name, message } = error as Error;
  if (name !== 'SecurityError') return unsupported('a session that the browser grants', message);
  return new GaussianSplatError('argument/activation', {
    where: '<gaussian-splat>',
    expected: 'a call in the handler of a click, with nothing awaited before it',
    found: message,
    remedy: 'call activateVR() or activateAR() first in the handler',
    cause: error,
  });
}
