import '@gaussian-splat/element';
import type { CameraChangeDetail, GaussianSplatElement } from '@gaussian-splat/element';
import { emulateMedia, resetMouse, sendKeys, sendMouse } from '@web/test-runner-commands';
import { assert, assertEqual, claimFault, frames, showLoaded, until } from './support/harness.js';
import { isRed, screenOf, sendTouch, turnWheel } from './support/screen.js';

const degrees = (radians: number): number => (radians * 180) / Math.PI;

interface Place {
  readonly theta: number;
  readonly phi: number;
  readonly radius: number;
  readonly target: readonly number[];
}

function placeOf(element: GaussianSplatElement): Place {
  const { theta, phi, radius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  return { theta: degrees(theta), phi: degrees(phi), radius, target: [x, y, z] };
}

/** The camera after an input, once all motion has ended. */
async function settled(element: GaussianSplatElement): Promise<Place> {
  let before = '';
  await until(() => {
    const now = JSON.stringify(placeOf(element));
    const isStill = now === before;
    before = now;
    return isStill;
  }, 'the camera to stand still');
  await frames();
  element.jumpCameraToGoal();
  return placeOf(element);
}

const close = (actual: number, expected: number, what: string, tolerance = 1e-6): void =>
  assert(Math.abs(actual - expected) <= tolerance, `${what}: expected ${expected}, found ${actual}`);

async function drag(
  from: readonly [number, number],
  to: readonly [number, number],
  button: 'left' | 'right' = 'left',
): Promise<void> {
  await sendMouse({ type: 'move', position: [...from] });
  await sendMouse({ type: 'down', button });
  await sendMouse({ type: 'move', position: [Math.round((from[0] + to[0]) / 2), Math.round((from[1] + to[1]) / 2)] });
  await sendMouse({ type: 'move', position: [...to] });
  await sendMouse({ type: 'up', button });
}

/** An element with controls at the page's corner: 120 x 100 pixels, orbit 0deg 75deg 10m. */
async function controlled(attributes: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> {
  document.body.style.margin = '0';
  return showLoaded({ 'camera-controls': '', 'camera-orbit': '0deg 75deg 10m', ...attributes });
}

afterEach(async () => {
  await resetMouse();
  scrollTo(0, 0);
});

describe('mouse', () => {
  it('a drag orbits, outside of the element too, and reports its source', async () => {
    const element = await controlled();
    const sources = new Set<string>();
    element.addEventListener('camera-change', (event: CustomEvent<CameraChangeDetail>) =>
      sources.add(event.detail.source),
    );
    await drag([60, 50], [35, 40]);
    const place = await settled(element);
    close(place.theta, 90, 'theta: 25 of 100 pixels are a quarter turn');
    close(place.phi, 75 + 36, 'phi');
    assertEqual([...sources], ['user-interaction'], 'sources');
    await drag([60, 50], [185, 50]);
    close((await settled(element)).theta, 90 - 450, 'theta after a drag beyond the edge');
  });

  it('the right button pans, and so does Shift', async () => {
    const element = await controlled({ 'camera-orbit': '0deg 90deg 4m' });
    const perPixel = (2 * 4 * Math.tan(element.getFieldOfView().radians / 2)) / 100;
    await drag([60, 50], [80, 40], 'right');
    const place = await settled(element);
    close(place.target[0], -20 * perPixel, 'x');
    close(place.target[1], -10 * perPixel, 'y');
    close(place.theta, 0, 'theta');
    await sendKeys({ down: 'Shift' });
    await drag([60, 50], [40, 60]);
    await sendKeys({ up: 'Shift' });
    close((await settled(element)).target[0], 0, 'x after panning back');
  });

  it('the wheel zooms, and the page does not scroll', async () => {
    const element = await controlled({ zoom: 'always' });
    document.body.style.height = '5000px';
    await turnWheel(60, 50, 100);
    const place = await settled(element);
    close(place.radius, 10 * Math.exp(0.2), 'radius');
    assertEqual(scrollY, 0, 'scroll');
    document.body.style.height = '';
  });

  it("without camera-controls, or with disable-zoom, the wheel is the page's", async () => {
    for (const attributes of [{ 'disable-zoom': '' }, null]) {
      const element = attributes
        ? await controlled(attributes)
        : await showLoaded({ 'camera-orbit': '0deg 75deg 10m' });
      document.body.style.height = '5000px';
      await turnWheel(60, 50, 100);
      await until(() => scrollY > 0, 'the page to scroll');
      close((await settled(element)).radius, 10, 'radius');
      scrollTo(0, 0);
      element.remove();
    }
    document.body.style.height = '';
  });

  it('without camera-controls nothing moves', async () => {
    const element = await showLoaded({ 'camera-orbit': '0deg 75deg 10m' });
    await drag([60, 50], [20, 20]);
    await sendKeys({ press: 'ArrowRight' });
    close((await settled(element)).theta, 0, 'theta');
  });

  it('disable-pan keeps the target', async () => {
    const element = await controlled({ 'disable-pan': '' });
    await drag([60, 50], [20, 20], 'right');
    close(Math.hypot(...(await settled(element)).target), 0, 'target');
  });

  it('controls may come and go', async () => {
    const element = await controlled();
    element.cameraControls = false;
    await element.updateComplete;
    await drag([60, 50], [20, 20]);
    close((await settled(element)).theta, 0, 'theta without');
    element.cameraControls = true;
    await element.updateComplete;
    await drag([60, 50], [35, 50]);
    close((await settled(element)).theta, 90, 'theta with');
  });
});

describe('keyboard', () => {
  it('arrows orbit, plus and minus and the page keys zoom, Shift and arrows pan, Home returns', async () => {
    const element = await controlled();
    element.focus();
    assertEqual(element.shadowRoot?.activeElement?.id, 'view', 'focus');
    const press = async (key: string): Promise<Place> => {
      await sendKeys({ press: key });
      return settled(element);
    };
    close((await press('ArrowRight')).theta, 22.5, 'ArrowRight');
    close((await press('ArrowLeft')).theta, 0, 'ArrowLeft');
    close((await press('ArrowUp')).phi, 52.5, 'ArrowUp');
    close((await press('ArrowDown')).phi, 75, 'ArrowDown');
    close((await press('+')).radius, 10 / 1.2, '+');
    close((await press('-')).radius, 10, '-');
    close((await press('PageUp')).radius, 10 / 1.2, 'PageUp');
    close((await press('PageDown')).radius, 10, 'PageDown');
    const panned = await press('Shift+ArrowRight');
    assert(panned.target[0] > 0.1, `target ${panned.target.join()}`);
    await press('ArrowRight');
    const home = await press('Home');
    close(home.theta, 0, 'theta at home');
    close(Math.hypot(...home.target), 0, 'target at home');
  });

  it("other keys stay the page's", async () => {
    const element = await controlled();
    const input = document.createElement('input');
    document.body.append(input);
    element.focus();
    await sendKeys({ press: 'Tab' });
    assertEqual(document.activeElement, input, 'Tab leaves');
  });

  it('the view is reached by Tab only with controls', async () => {
    const element = await showLoaded();
    assertEqual(element.shadowRoot?.querySelector('[tabindex]'), null, 'tabindex');
    element.cameraControls = true;
    await element.updateComplete;
    const view = element.shadowRoot?.querySelector<HTMLElement>('#view');
    assertEqual(view?.tabIndex, 0, 'tabindex');
    await sendKeys({ press: 'Tab' });
    assertEqual(element.shadowRoot?.activeElement, view, 'focus');
    assert(view && getComputedStyle(view).outlineStyle === 'auto', 'a focus ring');
  });
});

describe('touch', () => {
  it('one finger orbits, two pan and pinch', async () => {
    const element = await controlled({ 'touch-action': 'none' });
    await sendTouch('touchStart', [{ x: 60, y: 50, id: 1 }]);
    await sendTouch('touchMove', [{ x: 50, y: 50, id: 1 }]);
    await sendTouch('touchMove', [{ x: 25, y: 50, id: 1 }]);
    await sendTouch('touchEnd', []);
    close((await settled(element)).theta, 90, 'theta: the way since it was known whose the finger is');
    await sendTouch('touchStart', [
      { x: 50, y: 50, id: 1 },
      { x: 70, y: 50, id: 2 },
    ]);
    await sendTouch('touchMove', [
      { x: 40, y: 50, id: 1 },
      { x: 80, y: 50, id: 2 },
    ]);
    await sendTouch('touchEnd', []);
    const place = await settled(element);
    close(place.radius, 5, 'radius after spreading to twice the distance', 0.1);
    close(place.theta, 90, 'theta');
  });

  it("with disable-zoom two fingers are the page's, which people zoom to read", async () => {
    const surfaceOf = (element: Element) => element.shadowRoot?.querySelector<HTMLElement>('#view');
    const element = await controlled({ 'disable-zoom': '' });
    assertEqual(surfaceOf(element)?.style.touchAction, 'pan-y pinch-zoom');
    const prevented: boolean[] = [];
    addEventListener('touchmove', ({ defaultPrevented }) => prevented.push(defaultPrevented), { once: true });
    await sendTouch('touchStart', [
      { x: 50, y: 50, id: 1 },
      { x: 70, y: 50, id: 2 },
    ]);
    await sendTouch('touchMove', [
      { x: 50, y: 45, id: 1 },
      { x: 70, y: 45, id: 2 },
    ]);
    await sendTouch('touchEnd', []);
    assertEqual(prevented, [false]);
    const place = await settled(element);
    close(Math.hypot(...place.target), 0, 'target');
    const free = await controlled({ 'disable-zoom': '', 'touch-action': 'none' });
    assertEqual(surfaceOf(free)?.style.touchAction, 'pinch-zoom');
  });

  it('by default a vertical move of one finger scrolls the page', async () => {
    const element = await controlled();
    document.body.style.height = '5000px';
    assertEqual(element.shadowRoot?.querySelector<HTMLElement>('#view')?.style.touchAction, 'pan-y');
    await sendTouch('touchStart', [{ x: 60, y: 90, id: 1 }]);
    for (let y = 80; y >= 10; y -= 10) await sendTouch('touchMove', [{ x: 60, y, id: 1 }]);
    await sendTouch('touchEnd', []);
    await until(() => scrollY > 10, 'the page to scroll');
    const scrolled = await settled(element);
    close(scrolled.phi, 75, 'phi');
    close(scrolled.theta, 0, 'theta');
    document.body.style.height = '';
  });

  it('and a horizontal one orbits', async () => {
    const element = await controlled();
    await sendTouch('touchStart', [{ x: 100, y: 50, id: 1 }]);
    for (let x = 90; x >= 30; x -= 10) await sendTouch('touchMove', [{ x, y: 50, id: 1 }]);
    await sendTouch('touchEnd', []);
    assert((await settled(element)).theta > 90, `theta ${placeOf(element).theta}`);
  });
});

describe('motion', () => {
  it('is damped', async () => {
    const element = await controlled({ 'interpolation-decay': '200' });
    element.focus();
    const seen: number[] = [];
    element.addEventListener('camera-change', () => seen.push(placeOf(element).theta));
    await sendKeys({ press: 'ArrowRight' });
    await until(() => seen.length > 5, 'some frames');
    assert(
      seen.every((theta, i) => i === 0 || theta >= seen[i - 1]),
      `rising: ${seen.join()}`,
    );
    assert(seen[0] < 20, `no jump: ${seen[0]}`);
  });

  it('is not, for people who want less motion', async () => {
    await emulateMedia({ reducedMotion: 'reduce' });
    try {
      const element = await controlled({ 'interpolation-decay': '200' });
      element.focus();
      let changes = 0;
      element.addEventListener('camera-change', () => changes++);
      await sendKeys({ press: 'ArrowRight' });
      await until(() => changes > 0, 'a frame');
      close(placeOf(element).theta, 22.5, 'theta after one frame');
    } finally {
      await emulateMedia({ reducedMotion: 'no-preference' });
    }
  });
});

describe('camera attributes', () => {
  it('what the getters print, the attributes take', async () => {
    const element = await controlled();
    await drag([60, 50], [20, 33]);
    await settled(element);
    const copy = await showLoaded({
      'camera-orbit': String(element.getCameraOrbit()),
      'camera-target': String(element.getCameraTarget()),
      'field-of-view': String(element.getFieldOfView()),
    });
    assertEqual(JSON.stringify(placeOf(copy)), JSON.stringify(placeOf(element)));
  });

  it('a malformed one takes its default and warns once', async () => {
    const element = await showLoaded({ 'camera-orbit': 'somewhere nice' });
    claimFault(/console\.warn: <gaussian-splat> camera-orbit: expected .* found "somewhere nice"/);
    close(placeOf(element).phi, 75, 'phi');
    element.alt = 'anything, to update';
    await element.updateComplete;
  });

  it('up turns the scene', async () => {
    const element = await showLoaded({ up: 'y' });
    const { x, y, z } = element.getCameraTarget();
    close(Math.hypot(x, y, z), 0, 'target');
    element.up = '-z';
    await element.updateComplete;
    await frames();
    assert(element.loaded, 'still there');
  });

  it('up of a capture that is tilted: a direction, upright in the frame and in viewer space', async () => {
    // The compass has red at +x of its frame, 1 from the middle: at -2 of 5 up, that is 22 degrees below the horizon.
    const element = await showLoaded({ up: '-2 -5 0', 'camera-orbit': '0deg 90deg auto', 'interpolation-decay': '0' });
    const level = await showLoaded({ 'camera-orbit': '0deg 90deg auto' });
    const heightOf = async (one: GaussianSplatElement): Promise<number> => {
      const red = (await screenOf(one)).middleOf(isRed);
      assert(red, 'red');
      return red.y - one.clientHeight / 2;
    };
    const [below, straight] = [await heightOf(element), await heightOf(level)];
    assert(Math.abs(straight) < 2 && below > 5, `red ${straight} and ${below} pixels below the middle`);
  });
});

describe('accessibility', () => {
  it('an image without controls, an application with, named by alt, aria-label or a default', async () => {
    const element = await showLoaded();
    const view = element.shadowRoot?.querySelector('#view');
    const described = (): (string | null | undefined)[] => [
      view?.getAttribute('role'),
      view?.getAttribute('aria-label'),
    ];
    assertEqual(described(), ['img', '3D scene'], 'default');
    element.alt = 'A skull';
    await element.updateComplete;
    assertEqual(described(), ['img', 'A skull'], 'alt');
    element.cameraControls = true;
    await element.updateComplete;
    assertEqual(described(), ['application', 'A skull'], 'controls');
    assert(view && view.hasAttribute('aria-roledescription'), 'a role description');
    const helpOf = (): HTMLElement | null | undefined =>
      element.shadowRoot?.getElementById(view.getAttribute('aria-describedby') ?? '');
    await until(() => !!helpOf(), 'the help, which comes with what listens to keys');
    const help = helpOf();
    assert(/Arrow keys/.test(help?.textContent ?? ''), 'the keys are described');
    element.cameraControls = false;
    element.alt = '';
    await element.updateComplete;
    assertEqual(described(), ['presentation', null], 'decorative');
    const labelled = await showLoaded({ 'aria-label': 'From the host' });
    const name = (): string | null | undefined =>
      labelled.shadowRoot?.querySelector('#view')?.getAttribute('aria-label');
    assertEqual(name(), 'From the host');
    labelled.ariaLabel = 'Another';
    await until(() => name() === 'Another', 'the new name', 2_000);
  });
});
