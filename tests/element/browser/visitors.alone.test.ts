/** Visitors who get lost, who scroll past, who drag over an obstacle: the element's help for each. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { resetMouse, sendKeys, sendMouse } from '@web/test-runner-commands';
import { itInLab, isLab } from '../../support/extent-in-pages.js';
import { randomSource } from '../../support/gpu.js';
import { assert, assertEqual, delay, frames, hurry, showLoaded, until } from './support/harness.js';
import { screenOf, sendTouch, Taps, turnWheel, type Rgb } from './support/screen.js';

const STILL = { 'camera-controls': '', 'interaction-prompt': 'none', 'interpolation-decay': '0' };
const [WIDTH, HEIGHT] = [200, 160];
const SIZE = `width: ${WIDTH}px; height: ${HEIGHT}px; background: rgb(90 90 90)`;

async function scene(attributes: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> {
  document.body.style.margin = '0';
  return showLoaded({ ...STILL, ...attributes }, SIZE);
}

const degrees = (radians: number): number => (radians * 180) / Math.PI;
const theta = (element: GaussianSplatElement): number => degrees(element.getCameraOrbit().theta);
const partOf = (element: Element, name: string): HTMLElement | null =>
  element.shadowRoot?.querySelector(`[part=${name}]`) ?? null;
const surfaceOf = (element: Element): HTMLElement => element.shadowRoot!.querySelector<HTMLElement>('#view')!;
const distance = (element: GaussianSplatElement): number => {
  const { x, y, z } = element.getCameraTarget();
  return Math.hypot(x, y, z);
};

const isScene = ([r, g, b]: Rgb): boolean => Math.abs(r - 90) + Math.abs(g - 90) + Math.abs(b - 90) > 30;
const seenPixels = async (element: Element): Promise<number> => (await screenOf(element)).middleOf(isScene)?.count ?? 0;

async function drag(from: readonly number[], to: readonly number[], button: 'left' | 'right' = 'left'): Promise<void> {
  await sendMouse({ type: 'move', position: [from[0], from[1]] });
  await sendMouse({ type: 'down', button });
  for (const share of [0.3, 0.6, 1]) {
    const position = [0, 1].map((k) => Math.round(from[k] + share * (to[k] - from[k]))) as [number, number];
    await sendMouse({ type: 'move', position });
  }
  await sendMouse({ type: 'up', button });
}

async function swipe(fingers: readonly (readonly [from: readonly number[], to: readonly number[]])[]): Promise<void> {
  const at = (share: number): { x: number; y: number; id: number }[] =>
    fingers.map(([from, to], id) => ({
      x: Math.round(from[0] + share * (to[0] - from[0])),
      y: Math.round(from[1] + share * (to[1] - from[1])),
      id,
    }));
  await sendTouch('touchStart', at(0));
  for (const share of [0.3, 0.6, 1]) await sendTouch('touchMove', at(share));
  await sendTouch('touchEnd', []);
}

async function doubleTap(x: number, y: number): Promise<void> {
  const taps = new Taps();
  for (let k = 0; k < 2; k++) await taps.tap(x, y);
}

afterEach(async () => {
  await resetMouse();
  document.body.style.height = '';
  scrollTo(0, 0);
});

const GESTURES = isLab ? 100 : 40;

describe('visitors never lose the scene', () => {
  const random = randomSource(11);
  const point = (): number[] => [Math.round(random() * WIDTH), Math.round(random() * HEIGHT)];
  /** The same events as from a hand, without the browser's time between them. */
  const gesture = (surface: HTMLElement, pointerType: 'mouse' | 'touch', button: number, ways: number[][][]): void => {
    const report = (type: string, [clientX, clientY]: number[], pointerId: number): void => {
      const buttons = type === 'pointerup' ? 0 : button === 2 ? 2 : 1;
      const pointer = { pointerType, pointerId: pointerId + 1, button, buttons, clientX, clientY, bubbles: true };
      surface.dispatchEvent(new PointerEvent(type, pointer));
    };
    ways.forEach(([from], id) => report('pointerdown', from, id));
    for (const share of [0.2, 0.6, 1]) {
      ways.forEach(([from, to], id) => report('pointermove', from.map((v, k) => v + share * (to[k] - v)), id)); // prettier-ignore
    }
    ways.forEach(([, to], id) => report('pointerup', to, id));
  };

  it(`by ${GESTURES} gestures of fingers: it is visible, or one tap on the button away`, async () => {
    const element = await scene({ 'touch-action': 'none' });
    const { radius } = element.getCameraOrbit();
    let away = 0;
    for (let i = 0; i < GESTURES; i++) {
      const ways = random() < 0.3 ? [[point(), point()]] : [[point(), point()], [point(), point()]]; // prettier-ignore
      gesture(surfaceOf(element), 'touch', 0, ways);
      element.jumpCameraToGoal();
      assert(distance(element) < radius / 2, `gesture ${i}: ${distance(element)} m off`);
      if (i % 10 !== 9 || (await seenPixels(element)) > 20) continue;
      away++;
      partOf(element, 'reset-button')!.click();
      await until(() => distance(element) < 1e-6, 'the middle');
      assert((await seenPixels(element)) > 100, 'the scene');
    }
    // In the middle of the compass there is nothing, and a pinch may end there.
    assert(away < GESTURES / 10, `${away} times of ${GESTURES / 10}`);
  });

  it(`by ${GESTURES} gestures of a mouse: it is visible, or a double click away`, async () => {
    const element = await scene({ zoom: 'always' });
    const { radius } = element.getCameraOrbit();
    for (let i = 0; i < GESTURES; i++) {
      const kind = random();
      if (kind < 0.6) gesture(surfaceOf(element), 'mouse', kind < 0.3 ? 2 : 0, [[point(), point()]]);
      else
        surfaceOf(element).dispatchEvent(new WheelEvent('wheel', { deltaY: 600 * (random() - 0.5), cancelable: true }));
      element.jumpCameraToGoal();
      assert(distance(element) < radius / 2, `gesture ${i}: ${distance(element)} m off`);
      if (i % 10 !== 9 || (await seenPixels(element)) > 20) continue;
      surfaceOf(element).dispatchEvent(new MouseEvent('dblclick', { clientX: 2, clientY: 2 }));
      await until(() => distance(element) < 1e-6, 'the middle');
      assert((await seenPixels(element)) > 100, 'the scene');
    }
  });

  it('two swipes of two fingers and ten right drags leave it visible', async () => {
    const element = await scene();
    for (let i = 0; i < 2; i++) await swipe([[[60, 30], [60, 150]], [[140, 30], [140, 150]]]); // prettier-ignore
    assert((await seenPixels(element)) > 100, 'after swipes');
    for (let i = 0; i < 10; i++) await drag([20, 20], [180, 140], 'right');
    assert((await seenPixels(element)) > 100, 'after drags');
  });

  it('a double tap beside the scene brings it back, except with disable-tap', async () => {
    const element = await scene({ 'touch-action': 'none', 'camera-orbit': '0deg 90deg 8m' });
    await swipe([[[100, 80], [60, 80]]]); // prettier-ignore
    const turned = theta(element);
    assert(Math.abs(turned) > 20, `theta ${turned}`);
    element.disableTap = true;
    await element.updateComplete;
    await doubleTap(4, 4);
    await delay(300);
    assertEqual(theta(element), turned, 'with disable-tap');
    element.disableTap = false;
    await element.updateComplete;
    await doubleTap(4, 4);
    await until(() => theta(element) === 0, 'the view of the attributes');
  });

  it('fingers get a button for it once the camera has moved; a mouse, which has the Home key, none', async () => {
    const element = await scene({ 'touch-action': 'none' });
    assertEqual(partOf(element, 'reset-button'), null, 'at first');
    await drag([100, 80], [60, 80]);
    await element.updateComplete;
    assertEqual(partOf(element, 'reset-button'), null, 'after a mouse');
    await swipe([[[100, 80], [60, 80]]]); // prettier-ignore
    await until(() => partOf(element, 'reset-button') !== null, 'the button');
    const button = partOf(element, 'reset-button')!;
    assertEqual(button.getAttribute('aria-label'), 'Reset view', 'name');
    const { width, height } = button.getBoundingClientRect();
    assert(width >= 24 && height >= 24, `${width} x ${height}`);
    button.click();
    await until(() => theta(element) === 0, 'the view of the attributes');
    await until(() => partOf(element, 'reset-button') === null, 'the button to go');
    assertEqual(element.shadowRoot?.activeElement?.id, 'view', 'focus');
  });

  for (const dir of ['ltr', 'rtl'])
    it(`that button, the ruler's and the pause button do not overlap: ${dir}`, async () => {
      const element = await scene({ dir, measure: '', 'auto-rotate': '', 'touch-action': 'none' });
      const names = ['reset-button', 'measure-button', 'pause-button'];
      await swipe([[[100, 80], [60, 80]]]); // prettier-ignore
      await until(() => names.every((name) => partOf(element, name) !== null), 'the buttons');
      const boxes = names.map((name) => partOf(element, name)!.getBoundingClientRect());
      boxes.forEach((a, i) =>
        boxes.slice(i + 1).forEach((b, k) => {
          const isApart = a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
          assert(isApart, `${names[i]} and ${names[i + 1 + k]}`);
        }),
      );
    });
});

describe('a camera attribute counts whenever it is set', () => {
  it('to the same value too, as an attribute and as a property', async () => {
    const element = await scene({ 'camera-orbit': '90deg 75deg 6m' });
    const sets = [
      () => (element.cameraOrbit = '90deg 75deg 6m'),
      () => element.setAttribute('camera-orbit', '90deg 75deg 6m'),
      () => ((element.cameraOrbit = '90deg 75deg 6m'), element.jumpCameraToGoal()),
    ];
    for (const set of sets) {
      await drag([100, 80], [60, 80]);
      await until(() => Math.abs(theta(element) - 90) > 20, 'the drag');
      set();
      await until(() => Math.abs(theta(element) - 90) < 1e-6, 'the bookmark');
    }
    element.fieldOfView = '30deg';
    element.cameraTarget = '0.1 0 0';
    await frames(3);
    await drag([100, 80], [60, 80]);
    const turned = theta(element);
    element.cameraTarget = '0.1 0 0';
    element.fieldOfView = '30deg';
    await frames(3);
    assertEqual(theta(element), turned, 'what was not set stays');
  });
});

describe('the wheel', () => {
  const radius = (element: GaussianSplatElement): number => element.getCameraOrbit().radius;

  it('scrolls a page past a scene without the focus, and zooms with Ctrl and after a click', async () => {
    const element = await scene();
    document.body.style.height = '5000px';
    const before = radius(element);
    await turnWheel(100, 80, 60);
    await until(() => scrollY > 0, 'the page to scroll');
    assertEqual(radius(element), before, 'radius');
    scrollTo(0, 0);
    await sendKeys({ down: 'Control' });
    await turnWheel(100, 80, -60);
    await sendKeys({ up: 'Control' });
    await until(() => radius(element) < before, 'the zoom with Ctrl');
    const zoomed = radius(element);
    await sendMouse({ type: 'click', position: [100, 80] });
    await turnWheel(100, 80, -60);
    await until(() => radius(element) < zoomed, 'the zoom after a click');
    assertEqual(scrollY, 0, 'scroll');
  });

  it('scrolls a component whose shadow tree scrolls what is in its slot', async () => {
    const component = document.createElement('div');
    component.attachShadow({ mode: 'open' }).innerHTML =
      '<div style="height: 200px; overflow-y: auto"><slot></slot><p style="height: 2000px"></p></div>';
    document.body.append(component);
    const element = await scene();
    component.append(element);
    await element.ready;
    const before = radius(element);
    await turnWheel(100, 80, 60);
    await until(() => component.shadowRoot!.firstElementChild!.scrollTop > 0, 'the component to scroll');
    assertEqual(radius(element), before, 'radius');
    component.remove();
  });

  it('is left to the page if it moves to the side, as over a carousel', async () => {
    const element = await scene({ zoom: 'always' });
    const before = radius(element);
    const wheel = (deltaX: number, deltaY: number): boolean => {
      const event = new WheelEvent('wheel', { deltaX, deltaY, bubbles: true, cancelable: true, composed: true });
      surfaceOf(element).dispatchEvent(event);
      return event.defaultPrevented;
    };
    assertEqual(wheel(40, 3), false, 'canceled');
    assertEqual(radius(element), before, 'radius');
    assertEqual(wheel(3, 40), true, 'canceled, of one up or down');
    await until(() => radius(element) > before, 'the zoom');
  });

  it('zooms at once where nothing scrolls, and always with zoom="always"', async () => {
    const element = await scene();
    const before = radius(element);
    await turnWheel(100, 80, 60);
    await until(() => radius(element) > before, 'the zoom on a page that fits');
    document.body.style.height = '5000px';
    element.zoom = 'always';
    await element.updateComplete;
    const zoomed = radius(element);
    await turnWheel(100, 80, 60);
    await until(() => radius(element) > zoomed, 'the zoom');
    assertEqual(scrollY, 0, 'scroll');
  });

  it("is the page's again at the limit of the zoom", async () => {
    await scene({ zoom: 'always' });
    document.body.style.height = '5000px';
    for (let i = 0; i < 40 && scrollY === 0; i++) {
      await turnWheel(100, 80, 200);
      await delay(150);
    }
    assert(scrollY > 0, 'the page has scrolled');
  });

  it('needs Ctrl with zoom="ctrl", never zooms with zoom="none"; fingers do in any case', async () => {
    const element = await scene({ zoom: 'ctrl', 'touch-action': 'none' });
    document.body.style.height = '5000px';
    const before = radius(element);
    element.focus();
    await turnWheel(100, 80, 60);
    await until(() => scrollY > 0, 'the page to scroll');
    assertEqual(radius(element), before, 'zoom="ctrl"');
    scrollTo(0, 0);
    element.zoom = 'none';
    await element.updateComplete;
    await swipe([[[90, 80], [60, 80]], [[110, 80], [140, 80]]]); // prettier-ignore
    await until(() => radius(element) < before, 'the pinch');
  });
});

describe('drags', () => {
  const label = (element: Element, tag = 'button'): HTMLElement => {
    const child = document.createElement(tag);
    child.slot = 'hotspot-middle';
    child.textContent = 'A label that covers much';
    child.dataset.position = '0m 0m 1m';
    element.append(child);
    return child;
  };

  it('that begin on a hotspot turn the scene; a click on it is a click', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m' });
    const button = label(element);
    let clicks = 0;
    button.addEventListener('click', () => clicks++);
    await until(() => element.queryHotspot('hotspot-middle')?.visible === true, 'the label');
    await drag([100, 80], [60, 80]);
    // The gesture counts from the point at which it was a drag and no click.
    assert(theta(element) > 50 && theta(element) <= 90, `theta ${theta(element)}`);
    assertEqual(clicks, 0, 'clicks of a drag');
    element.cameraOrbit = '0deg 90deg 8m';
    await frames(3);
    await sendMouse({ type: 'click', position: [100, 80] });
    assertEqual(clicks, 1, 'clicks of a click');
    document.body.style.height = '5000px';
    element.zoom = 'always';
    await element.updateComplete;
    const { radius } = element.getCameraOrbit();
    await turnWheel(100, 80, 60);
    await until(() => element.getCameraOrbit().radius > radius, 'the zoom over a label');
  });

  it('of one finger that begin on a hotspot turn the scene', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m' });
    label(element);
    await until(() => element.queryHotspot('hotspot-middle')?.visible === true, 'the label');
    await swipe([[[100, 80], [40, 80]]]); // prettier-ignore
    await until(() => theta(element) > 50, 'the turn');
  });

  it('of one finger on a hotspot and one beside it pinch', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m', 'touch-action': 'none' });
    label(element);
    await until(() => element.queryHotspot('hotspot-middle')?.visible === true, 'the label');
    await swipe([[[100, 80], [70, 80]], [[150, 80], [180, 80]]]); // prettier-ignore
    await until(() => element.getCameraOrbit().radius < 5, 'the pinch');
  });

  it("of a slider in a hotspot are the slider's", async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m' });
    const slider = label(element, 'input') as HTMLInputElement;
    slider.type = 'range';
    await until(() => element.queryHotspot('hotspot-middle')?.visible === true, 'the label');
    await drag([100, 80], [60, 80]);
    assertEqual([theta(element), slider.value !== '50'], [0, true]);
  });

  it("inside a link are the camera's to their end, and open nothing", async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m' });
    const link = document.createElement('a');
    link.href = '#opened';
    element.replaceWith(link);
    link.append(element);
    await frames(2);
    await drag([100, 80], [60, 80]);
    assert(Math.abs(theta(element) - 90) < 1e-6, `theta ${theta(element)}`);
    assertEqual(location.hash, '', 'address after a drag');
    await sendMouse({ type: 'click', position: [100, 80] });
    await until(() => location.hash === '#opened', 'the link');
    history.replaceState(null, '', location.pathname + location.search);
  });
});

describe('a carousel that listens to pointers', () => {
  /** As such code is written: it slides by a pointer's movement, unless other code has used the move. */
  async function carouselAround(element: GaussianSplatElement): Promise<() => number> {
    const slides = document.createElement('div');
    slides.style.cssText = 'width: 600px; padding: 40px 0; touch-action: pan-y';
    element.replaceWith(slides);
    slides.append(element);
    let [last, slid] = [NaN, 0];
    slides.addEventListener('pointerdown', ({ clientX }) => (last = clientX));
    slides.addEventListener('pointermove', (event) => {
      if (Number.isNaN(last) || event.defaultPrevented) return;
      slid += event.clientX - last;
      last = event.clientX;
    });
    slides.addEventListener('pointerup', () => (last = NaN));
    await frames(2);
    return () => slid;
  }

  it('slides by drags beside the scene, and by none that turns it', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m' });
    const slid = await carouselAround(element);
    await drag([100, 100], [60, 100]);
    assert(Math.abs(theta(element) - 90) < 1e-6, `theta ${theta(element)}`);
    assertEqual(slid(), 0, 'by a drag that turns');
    await drag([400, 100], [360, 100]);
    assertEqual([Math.round(theta(element)), slid()], [90, -40], 'theta, and slid beside the scene');
  });

  it('slides by what the page keeps for itself: pans with disable-pan', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m', 'disable-pan': '' });
    const slid = await carouselAround(element);
    await drag([100, 100], [60, 100], 'right');
    assertEqual([theta(element), slid()], [0, -40]);
  });

  it('does not slide by two fingers, nor by one that turns the scene', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m', 'touch-action': 'none' });
    const slid = await carouselAround(element);
    await swipe([[[80, 100], [50, 100]], [[120, 100], [150, 100]]]); // prettier-ignore
    assert(element.getCameraOrbit().radius < 8, 'the pinch');
    await swipe([[[100, 100], [60, 100]]]); // prettier-ignore
    assert(theta(element) > 50, `theta ${theta(element)}`);
    // The first pixels of a finger do not say yet whose it is.
    assert(Math.abs(slid()) <= 14, `slid by ${slid()}`);
  });
});

describe('small and certain', () => {
  it('a point outside of the frame is not visible', async () => {
    const element = await scene({ 'camera-orbit': '0deg 90deg 8m' });
    for (const [name, position] of [
      ['in', '0m 0m 1m'],
      ['out', '40m 0m 0m'],
    ]) {
      // prettier-ignore
      const child = document.createElement('span');
      child.slot = `hotspot-${name}`;
      child.dataset.position = position;
      element.append(child);
    }
    await until(() => element.queryHotspot('hotspot-in')?.visible === true, 'the label in the frame');
    const out = element.queryHotspot('hotspot-out');
    assert(out && out.canvasPosition && out.canvasPosition.x > WIDTH, 'a place outside');
    assertEqual(out.visible, false, 'visible');
  });

  it('the height follows from the width by aspect-ratio', async () => {
    const sizes: Readonly<Record<string, readonly number[]>> = {
      '': [300, 150],
      'width: 400px': [400, 200],
      'width: 400px; aspect-ratio: 4 / 3': [400, 300],
      'width: 400px; height: 90px': [400, 90],
      'height: 90px': [300, 90],
      'position: absolute; inset: 0': [300, 150],
      'position: absolute; inset: 0; width: 100%; height: 100%': [innerWidth, innerHeight],
    };
    for (const [style, size] of Object.entries(sizes)) {
      const element = document.createElement('gaussian-splat');
      element.style.cssText = style;
      document.body.append(element);
      assertEqual([element.offsetWidth, element.offsetHeight], [...size], style);
      element.remove();
    }
  });

  it('under an emulated pixel ratio the canvas has device pixels', async () => {
    // So do DevTools and Playwright: scripts see another ratio, the observer of the size does not.
    const real = Object.getOwnPropertyDescriptor(window, 'devicePixelRatio')!;
    Object.defineProperty(window, 'devicePixelRatio', { configurable: true, value: 1.5 });
    try {
      const element = await showLoaded({}, 'width: 101.5px; height: 75.25px');
      const canvas = element.shadowRoot!.querySelector('canvas')!;
      assertEqual([canvas.width, canvas.height], [152, 113]);
    } finally {
      Object.defineProperty(window, 'devicePixelRatio', real);
    }
  });

  itInLab('the prompt stands low, and goes when it has been seen', async () => {
    const element = await showLoaded({ 'camera-controls': '', 'interaction-prompt-threshold': '0' }, SIZE);
    await until(() => partOf(element, 'interaction-prompt') !== null, 'the prompt');
    const { top, bottom } = partOf(element, 'interaction-prompt')!.getBoundingClientRect();
    const box = element.getBoundingClientRect();
    assert(bottom <= box.bottom && top > box.top + HEIGHT / 2, `from ${top} to ${bottom}`);
    hurry(10);
    await until(() => partOf(element, 'interaction-prompt') === null, 'the prompt to go', 5_000);
    await delay(5_000);
    assertEqual(partOf(element, 'interaction-prompt'), null, 'it stays away');
  });
});
