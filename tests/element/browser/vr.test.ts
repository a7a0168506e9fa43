/** VR with an emulated headset: both eyes against the oracle, sessions that begin and end, and all that may go wrong. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { executeServerCommand } from '@web/test-runner-commands';
import { fetchScene, readScene } from '@gaussian-splat/formats';
import { orderView, SplatOrder } from '@gaussian-splat/renderer/webgl';
import { renderOracle, toRgba } from '../../oracle/oracle.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { psnr } from '../../support/metrics.js';
import { violationsIn } from './support/axe.js';
import { headset } from './support/headset.js';
import {
  assert,
  assertEqual,
  claimComing,
  COMPASS,
  frames,
  nextEvent,
  showLoaded,
  submits,
  until,
} from './support/harness.js';
import { cameraOf } from './support/vr-camera.js';

const STILL = { 'interpolation-decay': '0', 'interaction-prompt': 'none', 'camera-orbit': '30deg 80deg 6m' };
const VR = { vr: '', 'camera-controls': '', ...STILL };
const BACKGROUND = [0.1, 0.1, 0.11, 1];
const MIN_DB = 59;
/** On a machine that has nothing else to do. */
const LIMIT_MS = 3_000;

interface XrLike extends EventTarget {
  isSessionSupported(mode: string): Promise<boolean>;
  requestSession(mode: string, options: object): Promise<{ end(): Promise<void> }>;
}
const xr = (): XrLike => (navigator as unknown as { xr: XrLike }).xr;

const buttonOf = (element: GaussianSplatElement): HTMLButtonElement | null =>
  element.shadowRoot!.querySelector('[part=vr-button]');

const unhandled: unknown[] = [];
addEventListener('unhandledrejection', ({ reason }) => unhandled.push(reason));

/** Sessions that were started, and the calls that started them. */
let session: { end(): Promise<void> } | undefined;

async function showVr(attributes: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> {
  headset();
  const element = await showLoaded({ ...VR, ...attributes });
  await until(() => buttonOf(element) !== null, 'the button', LIMIT_MS);
  return element;
}

/** Enters by a click, and waits until the scene is drawn. */
async function enter(element: GaussianSplatElement): Promise<void> {
  const { requestSession } = xr();
  let isAsked = false;
  xr().requestSession = function (mode, options) {
    isAsked = true;
    return requestSession.call(this, mode, options).then((begun) => (session = begun));
  };
  try {
    buttonOf(element)!.click();
    assert(isAsked, 'something was waited for before the session was asked for');
  } finally {
    xr().requestSession = requestSession;
  }
  await until(() => element.getAttribute('vr-status') === 'session-started', 'the session', LIMIT_MS);
  await until(() => isDrawn(), 'a frame in the headset', LIMIT_MS);
}

function isDrawn(): boolean {
  if (!headset().layer) return false;
  const bytes = headset().pixels('left');
  return bytes.some((value, i) => i % 4 === 0 && value > 100);
}

async function leave(element: GaussianSplatElement): Promise<void> {
  element.exitXR!();
  await until(() => buttonOf(element) !== null, 'the button after the session', LIMIT_MS);
  headset().layer = undefined;
}

describe('VR', () => {
  // Before the page is cleared: the emulator has a canvas in it.
  afterEach(async () => {
    await session?.end().catch(() => undefined);
    session = undefined;
    const { device } = headset();
    device.position.set(0, 1.6, 0);
    device.quaternion.set(0, 0, 0, 1);
    headset().layer = undefined;
  });

  it("draws each eye as the oracle of the eye's camera", async () => {
    headset().device.position.set(0, 1.6, 0);
    const element = await showVr();
    const cloud = await readScene(await fetchScene(COMPASS), { name: 'compass.splat' });
    await enter(element);
    for (const eye of ['left', 'right'] as const) {
      const camera = cameraOf(element, eye);
      const oracle = renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
      const rgba = toRgba(oracle);
      const expected = rgba.map((value, i) => {
        const behind = (1 - rgba[4 * Math.floor(i / 4) + 3]) * BACKGROUND[i % 4];
        return Math.round(255 * Math.min(1, value + behind)) / 255;
      });
      const found = Float32Array.from(headset().pixels(eye), (value) => value / 255);
      const decibels = psnr(found, expected, { mask: oracle.contributors, channels: 4, clamp: true });
      console.log(`${eye} eye: ${decibels.toFixed(1)} dB`);
      assert(decibels >= MIN_DB, `${eye} eye: ${decibels.toFixed(1)} dB`);
    }
    const before = headset().pixels('left');
    element.setAttribute('filter', 'antialiased');
    await until(
      () =>
        headset()
          .pixels('left')
          .some((value, i) => value !== before[i]),
      'the other filter',
      LIMIT_MS,
    );
    await leave(element);
  });

  it('a copy of an element in a session has a status of its own', async () => {
    const element = await showVr({ 'vr-status': 'session-started' });
    assertEqual(element.getAttribute('vr-status'), 'not-presenting', 'status');
  });

  it('sorts once a frame, and the page draws nothing meanwhile', async () => {
    const element = await showVr();
    await enter(element);
    const drawn = submits;
    const { sort } = SplatOrder.prototype;
    let [sorts, shown] = [0, 0];
    SplatOrder.prototype.sort = function (view, order) {
      sorts++;
      return sort.call(this, view, order);
    };
    const { clearBufferfv } = WebGL2RenderingContext.prototype;
    WebGL2RenderingContext.prototype.clearBufferfv = function (...args: [never, never, never]) {
      if ((args[2] as number[])[0] === BACKGROUND[0]) shown++;
      clearBufferfv.apply(this, args);
    };
    for (let step = 1; step <= 10; step++) {
      headset().device.position.set(0.01 * step, 1.6 + 0.001 * step, 0.02 * step);
      await frames(1);
    }
    Object.assign(SplatOrder.prototype, { sort });
    Object.assign(WebGL2RenderingContext.prototype, { clearBufferfv });
    assert(sorts > 5 && sorts <= shown, `${sorts} sorts in ${shown} frames`);
    assertEqual(submits, drawn, 'the page draws nothing meanwhile');
    await leave(element);
    await frames(3);
    assert(submits > drawn, 'the page draws again');
  });

  it('a session that is granted after the element has left or lost its attribute ends at once', async () => {
    const { requestSession } = xr();
    for (const leave of [(of: Element) => of.remove(), (of: Element) => of.removeAttribute('vr')]) {
      const element = await showVr();
      let grant: () => void = () => undefined;
      let ended: Promise<unknown> | undefined;
      xr().requestSession = async function (mode, options) {
        await new Promise<void>((resolve) => (grant = resolve));
        const begun = await requestSession.call(this, mode, options);
        ended = nextEvent(begun as unknown as EventTarget, 'end', LIMIT_MS);
        return begun;
      };
      try {
        const activated = element.activateVR!();
        leave(element);
        await element.updateComplete;
        grant();
        await activated;
        await ended;
      } finally {
        xr().requestSession = requestSession;
      }
      assertEqual(headset().layer, undefined, 'a layer');
      assertEqual(element.getAttribute('vr-status'), 'not-presenting', 'status');
      element.remove();
    }
  });

  it("takes a session from the browser's own button, which is offered again after each", async () => {
    headset();
    const offers: ((session: unknown) => void)[] = [];
    const system = xr() as XrLike & { offerSession?: unknown };
    system.offerSession = (mode: string) => {
      assertEqual(mode, 'immersive-vr', 'mode');
      return new Promise((accept) => offers.push(accept));
    };
    try {
      const element = await showVr();
      assertEqual(offers.length, 1, 'offers');
      offers[0](await xr().requestSession('immersive-vr', {}));
      await until(() => element.getAttribute('vr-status') === 'session-started', 'the session', LIMIT_MS);
      await until(() => isDrawn(), 'a frame in the headset', LIMIT_MS);
      await leave(element);
      await until(() => offers.length === 2, 'another offer', LIMIT_MS);
      element.remove();
      const late = (await xr().requestSession('immersive-vr', {})) as unknown as EventTarget;
      const ended = nextEvent(late, 'end', LIMIT_MS);
      offers[1](late);
      await ended;
    } finally {
      delete system.offerSession;
    }
  });

  it('one order by depth serves both eyes', async () => {
    const element = await showVr();
    const cloud = await readScene(await fetchScene('/demo/dist/scenes/skull.spz'), { name: 'skull.spz' });
    const sorter = new SplatOrder(cloud.positions);
    const orders = (['left', 'right'] as const).map((eye) => {
      const order = new Uint32Array(cloud.count);
      const view = orderView({ ...cameraOf(element, eye), near: 1e-6 }, cloud.origin);
      return order.subarray(0, sorter.sort(view, order));
    });
    assertEqual(orders[0].length > 1000 && orders[0].every((splat, i) => splat === orders[1][i]), true, 'same');
  });

  it('its buttons, those of AR and of the ruler, and walking have no fault that axe finds', async () => {
    const element = await showVr({ ar: '', measure: '', navigation: 'walk', unit: '1m' });
    const part = (name: string): HTMLElement | null => element.shadowRoot!.querySelector(`[part=${name}]`);
    await until(() => part('measure-button') !== null, 'the ruler', LIMIT_MS);
    assertEqual(await violationsIn(element), [], 'axe');
    part('measure-button')!.click();
    await frames(2);
    assertEqual(part('measure-button')!.getAttribute('aria-pressed'), 'true', 'pressed');
    assertEqual(await violationsIn(element), [], 'axe while measuring');
    await claimComing(/floor/);
  });

  const count = 100;
  itInLab(`${count} sessions leave nothing behind, and the camera where it was`, async () => {
    const contexts: WebGL2RenderingContext[] = [];
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, ...args: unknown[]) {
      const context = getContext.apply(this, args as never) as unknown;
      if (context instanceof WebGL2RenderingContext) contexts.push(context);
      return context;
    } as typeof getContext;
    try {
      const element = await showVr();
      const before = String(element.getCameraOrbit());
      const heaps: number[] = [];
      for (let i = 0; i < count; i++) {
        await enter(element);
        await leave(element);
        if (i % 45 === 9) heaps.push(await executeServerCommand<number, undefined>('heap-size'));
      }
      const perSession = (heaps[2] - heaps[1]) / 45;
      console.log(`heap after 10, 55 and 100 sessions: ${heaps.join(', ')} bytes, ${Math.round(perSession)} a session`);
      assertEqual(String(element.getCameraOrbit()), before, 'camera');
      await until(() => contexts.every((gl) => gl.isContextLost()), 'an end of all contexts of sessions', LIMIT_MS);
      assertEqual(element.getAttribute('vr-status'), 'not-presenting', 'status');
    } finally {
      HTMLCanvasElement.prototype.getContext = getContext;
    }
  });

  itInLab('ends when the scene changes, the element leaves, or the context is lost', async () => {
    const element = await showVr();
    await enter(element);
    let ended = nextEvent<CustomEvent<{ status: string }>>(element, 'vr-status', LIMIT_MS);
    element.src = `${COMPASS}?other`;
    assertEqual((await ended).detail.status, 'not-presenting', 'status after another src');
    await element.ready;
    await until(() => buttonOf(element) !== null, 'the button', LIMIT_MS);
    headset().layer = undefined;
    await enter(element);
    ended = nextEvent(element, 'vr-status', LIMIT_MS);
    (headset().layer!.context.getExtension('WEBGL_lose_context') as WEBGL_lose_context).loseContext();
    const { detail } = await ended;
    assertEqual(detail.status, 'failed', 'status after a loss');
    await until(() => buttonOf(element) !== null, 'the button', LIMIT_MS);
    headset().layer = undefined;
    await enter(element);
    ended = nextEvent(element, 'vr-status', LIMIT_MS);
    element.remove();
    assertEqual((await ended).detail.status, 'not-presenting', 'status after it was removed');
    assertEqual(unhandled.length, 0, String(unhandled));
  });

  itInLab('offers nothing where there is no headset, and says what is refused', async () => {
    headset();
    const { isSessionSupported, requestSession } = xr();
    try {
      for (const answer of [
        () => Promise.resolve(false),
        () => Promise.reject(new DOMException('no', 'SecurityError')),
      ]) {
        xr().isSessionSupported = answer;
        const element = await showLoaded(VR);
        await frames(4);
        assertEqual([buttonOf(element), element.canActivateVR ?? false], [null, false], 'button');
        element.remove();
      }
      await claimComing(/xr-spatial-tracking/);
      let answerLate: (isSupported: boolean) => void = () => undefined;
      xr().isSessionSupported = () => new Promise((resolve) => (answerLate = resolve));
      const element = await showLoaded(VR);
      await until(() => element.activateVR !== undefined, 'the code', LIMIT_MS);
      await frames(4);
      assertEqual(buttonOf(element), null, 'button');
      answerLate(true);
      await until(() => buttonOf(element) !== null, 'the button', LIMIT_MS);
      xr().requestSession = () => Promise.reject(new DOMException('no click', 'SecurityError'));
      const code = await element.activateVR!().catch((error: { code: string }) => error.code);
      assertEqual(code, 'argument/activation', 'code');
      assertEqual(element.getAttribute('vr-status'), 'failed', 'status');
      assertEqual(unhandled.length, 0, String(unhandled));
    } finally {
      Object.assign(xr(), { isSessionSupported, requestSession });
    }
  });

  itInLab("takes the page's own context where it draws with WebGL, and another where that never answers", async () => {
    const type = WebGL2RenderingContext.prototype as unknown as { makeXRCompatible: () => Promise<void> };
    const { makeXRCompatible } = type;
    try {
      for (const answer of [() => Promise.resolve(), () => new Promise<void>(() => undefined)]) {
        type.makeXRCompatible = answer;
        const element = await showVr({ renderer: 'webgl' });
        await enter(element);
        await leave(element);
        assertEqual(element.stats?.renderer, 'webgl', 'renderer');
        element.remove();
      }
    } finally {
      type.makeXRCompatible = makeXRCompatible;
    }
  });
});
