import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  FIXTURES,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
  hurry,
} from './support/harness.js';

const eventsOf = (element: GaussianSplatElement): string[] => {
  const seen: string[] = [];
  for (const type of ['loadstart', 'load', 'emptied', 'error', 'camera-change'])
    element.addEventListener(type, () => seen.push(type));
  return seen;
};

beforeEach(() => hurry(3));

describe('the address of the page', () => {
  const here = location.href;
  afterEach(() => history.replaceState(null, '', here));

  it('may change under a scene, as routers do it: a relative src is resolved once', async () => {
    history.replaceState(null, '', '/tests/element/browser/page');
    const element = await showLoaded({ src: 'fixtures/compass.splat' });
    const seen = eventsOf(element);
    history.pushState(null, '', '/another/place');
    element.alt = 'the same';
    await element.updateComplete;
    element.style.display = 'none';
    await delay(100);
    element.style.display = '';
    await frames(3);
    assertEqual(seen.filter((type) => type !== 'camera-change').length, 0, `events ${seen}`);
    assert(element.loaded, 'it stays');
    // Asked for again, it is another one.
    element.src = null;
    await element.updateComplete;
    element.src = 'fixtures/compass.splat';
    await nextEvent(element, 'error');
    assertEqual(element.error?.code, 'network');
  });

  it('each load is signed once, for any later result of urlModifier', async () => {
    let calls = 0;
    GaussianSplatElement.urlModifier = (url) => (url.includes('signed') ? `${url}&sig=${calls++}` : url);
    try {
      const element = show({ src: `${COMPASS}?signed` });
      const seen = eventsOf(element);
      await element.ready;
      element.alt = 'the same';
      await element.updateComplete;
      await delay(100);
      assertEqual(seen.filter((type) => type === 'loadstart').length, 1, 'loads');
      assertEqual(calls, 1, 'calls');
    } finally {
      GaussianSplatElement.urlModifier = null;
    }
  });
});

describe('a urlModifier', () => {
  const shown = async (modifier: (url: string) => string): Promise<GaussianSplatElement> => {
    GaussianSplatElement.urlModifier = modifier;
    try {
      const element = show({ src: COMPASS });
      await element.ready;
      return element;
    } finally {
      GaussianSplatElement.urlModifier = null;
    }
  };

  it('that throws is reported as any listener, and the address counts as it is', async () => {
    const { reportError } = window;
    const reported: string[] = [];
    window.reportError = (error) => reported.push(String(error));
    try {
      const element = await shown(() => {
        throw new Error('no token yet');
      });
      // Elements of tests before may still be about to go.
      assertEqual([element.loaded, element.error], [true, null], 'loaded');
      assert(reported.length > 0 && reported.every((sentence) => sentence === 'Error: no token yet'), reported.join());
    } finally {
      window.reportError = reportError;
    }
  });

  it('that returns no address, or a promise for one, is reported by the element, and the next scene loads', async () => {
    const element = await shown((async (url: string) => url) as unknown as (url: string) => string);
    assert(element.error?.message.includes('[object%20Promise]'), element.error?.message ?? 'no error');
    element.src = `${COMPASS}?next`;
    await element.ready;
    assertEqual([element.loaded, element.error], [true, null], 'loaded');
  });

  it('may give a relative address', async () => {
    assert((await shown(() => COMPASS)).loaded, 'loaded');
  });
});

describe('another src', () => {
  it('that waits to be seen: the error of the last one is gone', async () => {
    const element = show({ src: `${FIXTURES}missing.ply` });
    await nextEvent(element, 'error');
    assertEqual(element.progress, 0, 'progress');
    await element.updateComplete;
    const view = element.shadowRoot!.querySelector('#view')!;
    element.cameraControls = true;
    await element.updateComplete;
    assertEqual([view.getAttribute('role'), view.hasAttribute('tabindex')], ['img', false], 'nothing to move');
    element.style.position = 'absolute';
    element.style.top = '-9999px';
    await nextEvent(element, 'model-visibility');
    element.src = COMPASS;
    await element.updateComplete;
    assertEqual(element.error, null, 'error');
    await until(() => !element.shadowRoot!.querySelector('[part=error]'), 'its message to go');
    element.style.top = '0';
    await nextEvent(element, 'load');
    assertEqual(view.getAttribute('role'), 'application');
  });

  it('while the code that streams the last one is on its way: what has come stays', async () => {
    await fetch('/net/hold/gpu/open-streamed.js?ms=2500');
    const element = show({ src: '/net/nowhere/detail.json' });
    await nextEvent(element, 'loadstart');
    element.src = COMPASS;
    await nextEvent(element, 'load');
    await delay(3500);
    assert(element.loaded && element.stats !== null, 'it is gone');
    assert(element.toDataURL().startsWith('data:image/png'), 'its frame');
  });

  it('while counts are read back: they are those of now, or none', async () => {
    const element = await showLoaded();
    const reading = element.updateStats();
    element.src = null;
    assertEqual(await reading, null);
  });
});

describe('load()', () => {
  it('fetches the same src again: after an error, and when the file is another one', async () => {
    const src = '/net/kept/again/scene.splat';
    const put = async (name: string): Promise<void> => {
      await fetch(src, { method: 'PUT', body: await (await fetch(`${FIXTURES}${name}`)).blob() });
    };
    let signed = 0;
    GaussianSplatElement.urlModifier = (url) => (url.endsWith(src) ? `${url}?${signed++}` : url);
    try {
      const element = show({ src });
      await nextEvent(element, 'error');
      await put('green.splat');
      const seen = eventsOf(element);
      element.load();
      await element.ready;
      assertEqual([element.loaded, element.error, element.stats?.splats], [true, null, 1], 'after an error');
      await put('compass.splat');
      element.load();
      assertEqual(element.loaded, false, 'loaded meanwhile');
      await element.ready;
      assert(element.loaded && element.stats?.splats !== 1, 'the other file');
      const loads = seen.filter((type) => type !== 'camera-change');
      assertEqual(loads, ['emptied', 'loadstart', 'load', 'emptied', 'loadstart', 'load'], 'events');
      assertEqual(signed, 3, 'addresses signed');
    } finally {
      GaussianSplatElement.urlModifier = null;
    }
  });

  it('waits to be seen, and does nothing without a src', async () => {
    const below = show({ src: COMPASS }, 'width: 100px; height: 100px; margin-top: 5000px');
    const none = show({});
    const seen = [below, none].map(eventsOf);
    below.load();
    none.load();
    await none.ready;
    await delay(200);
    assertEqual([seen[0].includes('loadstart'), seen[1].length], [false, 0], 'events');
  });
});

describe('a hidden element', () => {
  it('keeps the distance that a person chose', async () => {
    const element = await showLoaded({ 'camera-controls': '' }, 'width: 60px; height: 200px');
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    view.focus();
    for (let k = 0; k < 40; k++) view.dispatchEvent(new KeyboardEvent('keydown', { key: '-', bubbles: true }));
    element.jumpCameraToGoal();
    const { radius } = element.getCameraOrbit();
    element.style.display = 'none';
    await delay(100);
    element.style.display = '';
    await frames(4);
    assertEqual(element.getCameraOrbit().radius, radius);
  });
});

describe('attributes and events', () => {
  it('"false" is off, for frameworks that write it', async () => {
    const element = await showLoaded({ 'camera-controls': 'false', 'auto-rotate': 'false' });
    assertEqual([element.cameraControls, element.autoRotate], [false, false]);
    element.setAttribute('camera-controls', '');
    assertEqual(element.cameraControls, true);
  });

  it('a mouse whose button is not held drags nothing; a held space bar scrolls nothing', async () => {
    const element = await showLoaded({ 'camera-controls': '', 'auto-rotate': '', 'auto-rotate-delay': '100000' });
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    const pointer = (type: string, clientX: number, buttons: number): boolean =>
      view.dispatchEvent(
        new PointerEvent(type, { pointerId: 7, pointerType: 'mouse', button: 0, buttons, clientX, clientY: 50 }),
      );
    const key = (init: KeyboardEventInit): boolean =>
      view.dispatchEvent(new KeyboardEvent('keydown', { ...init, cancelable: true, bubbles: true }));
    // The code for mouse and keys may come after the scene.
    await until(() => !key({ key: 'ArrowLeft' }), 'the code of mouse and keys');
    element.jumpCameraToGoal();
    const { theta } = element.getCameraOrbit();
    pointer('pointerdown', 20, 1);
    pointer('pointermove', 60, 0);
    pointer('pointermove', 90, 1);
    await frames(3);
    assertEqual(element.getCameraOrbit().theta, theta);
    const press = (repeat: boolean): boolean => key({ key: ' ', repeat });
    assertEqual([press(false), press(true), press(true)], [false, false, false], "all are the element's");
  });

  it('what was made in another window counts', async () => {
    const frame = document.createElement('iframe');
    document.body.append(frame);
    const other = frame.contentWindow as Window & typeof globalThis;
    const bytes = await (await fetch(COMPASS)).arrayBuffer();
    const element = show({});
    const hotspot = frame.contentDocument!.createElement('button');
    hotspot.slot = 'hotspot-other';
    hotspot.dataset.position = '0 0 0';
    element.append(hotspot);
    element.src = new other.File([bytes], 'compass.splat');
    await nextEvent(element, 'load');
    await until(() => element.queryHotspot('hotspot-other') !== null, 'the hotspot');
  });
});
