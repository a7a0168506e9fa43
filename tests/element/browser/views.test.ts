/** Views that people choose from, flights between them, and paths: by script, by pointer, by keyboard, and as screen readers have them. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { emulateMedia, resetMouse, sendKeys, sendMouse } from '@web/test-runner-commands';
import { itInLab } from '../../support/extent-in-pages.js';
import { violationsIn } from './support/axe.js';
import {
  assert,
  assertEqual,
  claimComing,
  claimFault,
  delay,
  frames,
  nextEvent,
  showLoaded,
  until,
} from './support/harness.js';

const STILL = {
  'camera-controls': '',
  'interaction-prompt': 'none',
  'camera-orbit': '0deg 90deg 8m',
  alt: 'A compass',
};
const VIEWS = JSON.stringify([
  { name: 'Front', orbit: '0deg 90deg 8m' },
  { name: 'Right', orbit: '90deg 90deg 6m' },
  { name: 'Back', orbit: '180deg 90deg 8m', target: '0.5 0 0' },
]);
const FAST = { duration: 60 };

const scene = async (attributes: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> => {
  document.body.style.margin = '0';
  return showLoaded({ ...STILL, ...attributes }, 'width: 300px; height: 200px');
};
const theta = (element: GaussianSplatElement): number => (element.getCameraOrbit().theta * 180) / Math.PI;
const partOf = (element: Element, name: string): HTMLElement | null =>
  element.shadowRoot?.querySelector(`[part=${name}]`) ?? null;
const spoken = (element: Element): string => element.shadowRoot?.querySelector('[role=status]')?.textContent ?? '';
const near = (actual: number, expected: number, what: string, tolerance = 1e-6): void =>
  assert(Math.abs(actual - expected) <= tolerance, `${what}: expected ${expected}, found ${actual}`);
const code = (promise: Promise<unknown>): Promise<string> =>
  promise.then(
    () => 'none',
    (error: { code: string }) => error.code,
  );

afterEach(() => resetMouse());

describe('flyTo', () => {
  itInLab('goes there in its time, and fulfils on arrival', async () => {
    const element = await scene();
    const seen: number[] = [];
    element.addEventListener('camera-change', () => seen.push(theta(element)));
    const start = performance.now();
    assertEqual(await element.flyTo({ orbit: '90deg 60deg 4m' }, { duration: 500 }), true, 'arrived');
    const took = performance.now() - start;
    assert(took >= 480, `${took} ms`);
    near(theta(element), 90, 'theta');
    near(element.getCameraOrbit().radius, 4, 'radius');
    assert(seen.length > 3 && seen.every((value, i) => i === 0 || value >= seen[i - 1]), seen.join());
    element.resetCamera();
    element.jumpCameraToGoal();
    near(theta(element), 0, 'theta after a reset');
  });

  itInLab('begins where the camera is, which may be on its way to another place', async () => {
    const element = await scene({ 'interpolation-decay': '2000', views: VIEWS });
    await until(() => partOf(element, 'next-view') !== null, 'the bar');
    element.cameraOrbit = '150deg 90deg 8m';
    await until(() => theta(element) > 0, 'the way');
    const begun = nextEvent(element, 'view-change');
    const flight = element.flyTo('Back', { duration: 10_000 });
    await begun;
    const before = theta(element);
    await nextEvent(element, 'camera-change');
    await nextEvent(element, 'camera-change');
    assert(before < 90, `${before} degrees: the camera moves slowly`);
    assert(theta(element) < before + 30, `the flight begins with a jump from ${before} to ${theta(element)} degrees`);
    element.cameraOrbit = '0deg 90deg 8m';
    assertEqual(await flight, false, 'arrived');
  });

  it('is interrupted by gestures, attributes and another flight: false', async () => {
    const element = await scene();
    const takers = [
      () =>
        element.shadowRoot!.querySelector('#view')!.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' })),
      () => (element.cameraOrbit = '10deg 90deg 8m'),
      () => void element.flyTo({ orbit: '20deg 90deg 8m' }, FAST),
    ];
    for (const take of takers) {
      const flight = element.flyTo({ orbit: '170deg 90deg 8m' }, { duration: 20_000 });
      await until(() => Math.abs(theta(element)) > 0.01, 'the flight');
      take();
      assertEqual(await flight, false, 'arrived');
      element.cameraOrbit = '0deg 90deg 8m';
      element.jumpCameraToGoal();
      await frames(2);
    }
  });

  it('jumps for visitors who want less motion, and arrives off-screen', async () => {
    const element = await scene();
    await emulateMedia({ reducedMotion: 'reduce' });
    try {
      const changes: number[] = [];
      element.addEventListener('camera-change', () => changes.push(theta(element)));
      assertEqual(await element.flyTo({ orbit: '90deg 90deg 8m' }, { duration: 20_000 }), true);
      near(theta(element), 90, 'theta');
      await frames(3);
      assertEqual(changes, [90], 'changes');
    } finally {
      await emulateMedia({ reducedMotion: 'no-preference' });
    }
    element.style.marginTop = '5000px';
    await delay(300);
    assertEqual(await element.flyTo({ orbit: '45deg 90deg 8m' }, { duration: 20_000 }), true);
    near(theta(element), 45, 'theta off-screen');
  });

  it('takes a camera of a training, and refuses what is no view', async () => {
    const element = await scene();
    // Half a turn around y, seen from behind: in the frame of the file the eye is at +z and looks to -z.
    const rotation = [[-1, 0, 0], [0, 1, 0], [0, 0, -1]]; // prettier-ignore
    await element.flyTo({ position: [0, 0, 5], rotation, height: 100, fy: 100 }, FAST);
    near(Math.abs(theta(element)), 180, 'theta');
    near(element.getCameraOrbit().radius, 5, 'radius', 1e-3);
    near(element.getFieldOfView().radians, 2 * Math.atan(0.5), 'field of view');
    assertEqual(await code(element.flyTo('Nowhere')), 'argument/camera', 'a name that no view has');
    assertEqual(await code(element.flyTo({ orbit: 'over there' })), 'argument/camera', 'a malformed view');
  });
});

describe('a list of views', () => {
  it('has a bar, keys, an event and words; axe finds nothing', async () => {
    const element = await scene({ views: VIEWS });
    const reported: unknown[] = [];
    element.addEventListener('view-change', ({ detail }) => reported.push(detail));
    await until(() => partOf(element, 'next-view') !== null, 'the bar');
    const { left, top, width, height } = partOf(element, 'next-view')!.getBoundingClientRect();
    assert(width >= 24 && height >= 24, `${width} x ${height}`);
    await sendMouse({ type: 'click', position: [Math.round(left + width / 2), Math.round(top + height / 2)] });
    await until(() => spoken(element) === 'Front (1/3)', 'the words');
    assertEqual(partOf(element, 'view-name')?.textContent, 'Front', 'name');
    assertEqual(await violationsIn(element), [], 'axe');
    const leftOf = (name: string): number => partOf(element, name)!.getBoundingClientRect().left;
    const sign = partOf(element, 'next-view')!.querySelector('svg')!;
    assert(
      leftOf('previous-view') < leftOf('next-view') && getComputedStyle(sign).transform === 'none',
      'to the right',
    );
    element.dir = 'rtl';
    assert(leftOf('next-view') < leftOf('previous-view'), 'the next view is at the left');
    assert(getComputedStyle(sign).transform.startsWith('matrix(-1'), 'its sign points to the left');
    element.dir = '';
    element.focus();
    await sendKeys({ press: 'n' });
    await until(() => spoken(element) === 'Right (2/3)', 'N');
    near(theta(element), 90, 'theta');
    await sendKeys({ press: '3' });
    await until(() => spoken(element) === 'Back (3/3)', '3');
    near(element.getCameraTarget().x, 0.5, 'target');
    await sendKeys({ press: 'p' });
    await until(() => spoken(element) === 'Right (2/3)', 'P');
    assertEqual(reported, [0, 1, 2, 1].map((index) => ({ name: ['Front', 'Right', 'Back'][index], index })), 'view-change'); // prettier-ignore
    const ids = element.shadowRoot!.querySelector('#view')!.getAttribute('aria-describedby')!.split(' ');
    assert(
      ids.some((id) => /N and P/.test(element.shadowRoot!.getElementById(id)?.textContent ?? '')),
      ids.join(),
    );
    assertEqual(await element.previousView(FAST), true);
    near(theta(element), 0, 'theta');
    const both = await Promise.all([element.nextView(FAST), element.nextView(FAST)]);
    assertEqual(both, [false, true], 'the second flight takes over from the first');
    near(Math.abs(theta(element)), 180, 'theta two views on');
    element.a11y = { 'next-view': 'Weiter', front: 'Von vorn' };
    await until(() => partOf(element, 'next-view')?.getAttribute('aria-label') === 'Weiter', 'words of the page');
    element.views = null;
    await until(() => partOf(element, 'next-view') === null, 'the bar to go');
  });

  it('is also children: a hotspot with a camera, and buttons of the page', async () => {
    const element = await scene();
    element.innerHTML = `
      <button slot="hotspot-white" data-position="0m 0m 1m" data-orbit="90deg 90deg 5m">White</button>
      <button slot="view" data-orbit="-90deg 90deg 7m" data-target="auto">Left</button>
      <button slot="view" data-orbit="0deg 45deg 7m" data-target="auto" data-field-of-view="30deg">Above</button>`;
    const [white, left, above] = element.querySelectorAll('button');
    await until(() => partOf(element, 'next-view') !== null, 'the bar');
    white.click();
    await until(() => Math.abs(theta(element) - 90) < 1e-6, 'the flight of the hotspot');
    near(element.getCameraTarget().z, 1, 'it looks at its point');
    assertEqual([white, left].map((button) => button.ariaCurrent), ['true', null], 'aria-current'); // prettier-ignore
    above.click();
    await until(() => Math.abs(element.getFieldOfView().degrees - 30) < 1e-6, 'the flight of a button');
    assertEqual([white, left, above].map((button) => button.ariaCurrent), [null, null, 'true'], 'aria-current'); // prettier-ignore
    assertEqual(await element.nextView(FAST), true, 'after the last');
    near(theta(element), 90, 'comes the first');
    assertEqual(await violationsIn(element), [], 'axe');
    const box = left.getBoundingClientRect();
    assert(box.width > 0 && box.top < 60, `a button of the page in the bar: ${box.top}`);
  });

  it('may be a file, and says what is wrong with one', async () => {
    const cameras = [{ id: 0, img_name: 'IMG_1', position: [0, 0, -5], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }]; // prettier-ignore
    const element = await scene({ views: URL.createObjectURL(new Blob([JSON.stringify(cameras)])) });
    await until(() => partOf(element, 'view-name') !== null, 'the bar');
    assertEqual(await element.flyTo('IMG_1', FAST), true);
    near(element.getCameraOrbit().radius, 5, 'radius', 1e-3);
    element.views = '{"scenes": []}';
    await until(() => partOf(element, 'view-name') === null, 'no views');
    claimFault(/console\.warn: <gaussian-splat> views: .*expected a list of views/);
    element.views = '[{ "name": "Nowhere", "orbit": "far away" }]';
    await until(() => partOf(element, 'next-view') !== null, 'the bar');
    partOf(element, 'next-view')!.click();
    await claimComing(/console\.warn: <gaussian-splat> views: .*view\.orbit/);
  });

  itInLab('is a path: by a fraction of it, and in time', async () => {
    const element = await scene({ views: VIEWS });
    await element.seekPath(0.5);
    near(theta(element), 90, 'in the middle is the second of three');
    await element.seekPath(7);
    near(theta(element), 180, 'no farther than the end');
    // A page that does not scroll computes 0 / 0.
    await element.seekPath(NaN);
    near(theta(element), 0, 'the beginning');
    const seen: number[] = [];
    element.addEventListener('camera-change', () => seen.push(theta(element)));
    assertEqual(await element.flyPath({ duration: 400 }), true);
    near(theta(element), 180, 'theta at the end');
    assert(seen[0] < 90 && seen.length > 3, seen.join());
  });

  it('costs a page without one nothing', async () => {
    await scene();
    const fetched = (): boolean =>
      performance.getEntriesByType('resource').some(({ name }) => /views\/tour/.test(name));
    performance.clearResourceTimings();
    await delay(200);
    assertEqual(fetched(), false, 'its code is fetched');
  });
});
