import { GaussianSplatError } from '@gaussian-splat/core';
import type { ReactiveController, ReactiveControllerHost } from 'lit';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { buttonBarOf } from '../../viewer/button-bar.js';
import type { Viewer } from '../../viewer/viewer.js';
import type { XrDrawing } from './xr-drawing.js';
import { unsupported, type XrShown } from './xr-scene.js';
import { XrLoop, type XrGuide } from './xr-session.js';
import { xrOf, type XrMode, type XrSession, type XrSpace } from './webxr.js';

export type XrStatus = 'not-presenting' | 'session-started' | 'object-placed' | 'failed';

/** Definition of a kind of session, VR or AR. */
export interface XrKind {
  readonly mode: XrMode;
  /** Name of the attribute and of the button's slot, and prefix of the status event. */
  readonly name: 'vr' | 'ar';
  readonly word: keyof typeof WORDS;
  /** Whether the attributes of the page enable the session. */
  readonly isWanted: () => boolean;
  /** Returns the options for `requestSession`. Called in the click handler. */
  options(): object;
  /** Returns options without those that the browser may have refused; undefined if there are none. */
  simplerOptions?(): object | undefined;
  /** Called when a session was refused with {@link options} and granted with the simpler ones. */
  simplerGranted?(): void;
  /** Whether sessions can show what the element displays. */
  canShow(): boolean;
  /** Opens the drawing of a session. */
  open(session: XrSession, shown: XrShown): Promise<XrDrawing>;
  /** Types of reference spaces, the preferred one first. */
  readonly spaces: readonly string[];
  guide(started: XrStarted): XrGuide;
}

export interface XrStarted {
  readonly session: XrSession;
  readonly space: XrSpace;
  readonly spaceType: string;
  readonly drawing: XrDrawing;
  /** Signal that is aborted when the session ends. */
  readonly signal: AbortSignal;
  readonly offer: XrOffer;
}

/** A running session. */
interface Running {
  readonly session: XrSession;
  readonly over: AbortController;
  shown: LoadedGaussians | null;
  drawing?: XrDrawing;
  frames?: XrLoop;
  /** Signal of the drawing: it is replaced when a door leads to another scene. */
  drawn?: AbortController;
}

/** Offers one kind of session: shows a button if the browser supports it, runs the session, and reports its status. */
export class XrOffer implements ReactiveController {
  readonly core: Viewer;
  readonly kind: XrKind;
  readonly #element: ReactiveControllerHost & HTMLElement;
  readonly #slot: HTMLSlotElement;
  readonly #button: HTMLButtonElement;
  readonly #place: HTMLElement;
  /** Whether the browser can start sessions; undefined until it has answered. */
  #isSupported: boolean | undefined;
  #isStarting = false;
  /** Whether the browser's own button was requested for the next session. */
  #isOffered = false;
  #running: Running | undefined;
  #watching: AbortController | undefined;
  #isWarned = false;

  constructor(core: Viewer, kind: XrKind) {
    const { element } = core;
    this.#element = element;
    this.core = core;
    this.kind = kind;
    this.#place = buttonBarOf(core);
    const { ownerDocument: page } = element;
    this.#slot = Object.assign(page.createElement('slot'), { name: `${kind.name}-button` });
    this.#button = Object.assign(page.createElement('button'), { type: 'button' });
    this.#button.setAttribute('part', `${kind.name}-button`);
    this.#slot.append(this.#button);
    // The listener also handles a button that the author has put into the slot.
    this.#slot.addEventListener('click', () => {
      this.activate().catch((error: Error) => core.warn(error.message));
    });
    element.addController(this);
  }

  /** Whether a session can start: it is supported, enabled, and the scene is displayed. */
  get canActivate(): boolean {
    return this.#isSupported === true && this.kind.isWanted() && this.kind.canShow();
  }

  /** Whether the browser has answered that it cannot start sessions. */
  get isUnsupported(): boolean {
    return this.#isSupported === false;
  }

  get isPresenting(): boolean {
    return this.#running !== undefined;
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
    else {
      if (!this.#slot.isConnected) this.#place.append(this.#slot);
      this.#offer();
    }
    if (this.#running && this.#isOutdated(this.#running)) {
      if (this.core.features.first('keepsSession')) this.#await(this.#running);
      else this.end();
    }
  }

  /** Stops drawing in a session until the next scene of the page is shown, which the session then draws. */
  #await(running: Running): void {
    const { core } = this;
    if (!running.frames) return;
    this.#free(running);
    running.shown = null;
    const wait = (time: number): void => {
      if (running !== this.#running || running.frames) return;
      const { scene } = core.sources.ownEntry;
      if (scene.error || scene.state === 'empty') return this.end();
      if (scene.state === 'ready') {
        running.shown = scene.scene;
        this.#open(running).catch((error: Error) => this.#lost(running, error.message));
        return;
      }
      // Browsers of headsets stop the frames of the page during a session, and a scene is ready with its first one.
      core.view.drawFrame(time);
      running.session.requestAnimationFrame(wait);
    };
    running.session.requestAnimationFrame(wait);
  }

  /**
   * Whether the session must end: another source is requested, or the page's splats that the session draws were replaced
   * or destroyed.
   */
  #isOutdated({ drawing, frames, shown }: Running): boolean {
    const { sources } = this.core;
    const { scene } = sources.ownEntry;
    // It waits for the scene behind a door.
    if (shown === null && !frames) return false;
    return scene.isOutgoing || (drawing?.isOfPage === true && (scene.scene !== shown || sources.shown.length === 0));
  }

  hostDisconnected(): void {
    this.#watching?.abort();
    this.#watching = undefined;
    this.#isSupported = undefined;
    this.#isOffered = false;
    this.#slot.remove();
    this.end();
  }

  /** Requests the button that some browsers have for sessions. The last element of a page has it. */
  #offer(): void {
    if (this.#isOffered || this.#isStarting) return;
    this.#isOffered = true;
    const xr = xrOf(this.#element.ownerDocument.defaultView);
    xr?.offerSession?.(this.kind.mode, this.kind.options()).then(
      (session) => {
        // The offer cannot be withdrawn, so that the element may have changed meanwhile.
        if (!this.canActivate || this.#isStarting || this.#running) return void session.end().catch(() => undefined);
        this.#start(session).catch((error: Error) => this.core.warn(error.message));
      },
      () => undefined,
    );
  }

  /**
   * Starts a session. Call it in a click handler, without an earlier await.
   * @throws GaussianSplatError `unsupported/xr` if no session is available, `argument/activation` outside a click
   */
  activate(): Promise<void> {
    const xr = xrOf(this.#element.ownerDocument.defaultView);
    if (!xr || !this.canActivate) return Promise.reject(unsupported('a headset or a phone, and a scene file', 'none'));
    if (this.#isStarting || this.#running) return Promise.resolve();
    this.#isStarting = true;
    const { kind } = this;
    return xr
      .requestSession(kind.mode, kind.options())
      .catch(async (error: unknown) => {
        const simpler = (error as Error).name === 'SecurityError' ? undefined : kind.simplerOptions?.();
        if (!simpler) throw error;
        // The browser accepts a second request, unless the activation by the click has expired.
        const session = await xr.requestSession(kind.mode, simpler).catch(() => Promise.reject(error));
        kind.simplerGranted?.();
        return session;
      })
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
      .finally(() => (this.#isStarting = this.#isOffered = false));
  }

  end(): void {
    this.#running?.session.end().catch(() => undefined);
  }

  /** Reports the status in an attribute, for CSS, and by an event. @param reason Reason of a failure. */
  status(status: XrStatus, reason?: string): void {
    const name = `${this.kind.name}-status` as const;
    this.#element.setAttribute(name, status);
    this.#element.dispatchEvent(new CustomEvent(name, { detail: { status, ...(reason && { reason }) } }));
  }

  async #start(session: XrSession): Promise<void> {
    const { core } = this;
    // The element has left the page, or lost its attribute, while the browser asked the visitor.
    if (!this.#watching) return session.end().catch(() => undefined);
    const running: Running = { session, over: new AbortController(), shown: core.sources.ownEntry.scene.scene };
    this.#running = running;
    session.addEventListener('end', () => this.#ended(running), { once: true });
    core.reveal.dismiss();
    core.isShownElsewhere = true;
    core.sources.suspend();
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
    running.drawn = new AbortController();
    const signal = AbortSignal.any([over.signal, running.drawn.signal]);
    const drawing = (running.drawing = await kind.open(session, { shown, request: core.stillRequest }));
    if (signal.aborted) return this.#free(running);
    drawing.onLost = (what) => this.#lost(running, what);
    const [spaceType, space] = await spaceOf(session, kind.spaces);
    if (signal.aborted) return;
    const guide = kind.guide({ ...{ session, space, spaceType, signal, drawing }, offer: this });
    running.frames = new XrLoop(session, drawing, space, guide);
    await drawing.open(signal);
  }

  #lost(running: Running, what: string): void {
    if (running !== this.#running) return;
    this.status('failed', what);
    this.end();
  }

  #ended(running: Running): void {
    running.over.abort(new DOMException('the session is over', 'AbortError'));
    this.#free(running);
    this.#running = undefined;
    this.#isOffered = false;
    this.core.isShownElsewhere = false;
    // The page has drawn no frames meanwhile, so that this time does not count.
    this.core.sources.suspend();
    if (this.#element.getAttribute(`${this.kind.name}-status`) !== 'failed') this.status('not-presenting');
    this.core.requestFrame();
    this.#element.requestUpdate();
  }

  #free(running: Running): void {
    running.drawn?.abort(new DOMException('the session draws another scene', 'AbortError'));
    running.frames?.stop();
    running.frames = undefined;
    running.drawing?.destroy();
    running.drawing = undefined;
  }

  #watch(): void {
    const xr = xrOf(this.#element.ownerDocument.defaultView);
    if (!xr) this.#isSupported = false;
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
    const isNew = isSupported && !this.#isSupported && !this.#running;
    this.#isSupported = isSupported;
    // Copies of an element, for example in a page cache of a framework, have its attribute of then.
    if (isNew) this.status('not-presenting');
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

export const WORDS = {
  vr: 'View in VR',
  ar: 'View in your room',
  'ar-simplified': 'View a simplified model in AR',
  'exit-ar': 'Leave AR',
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
