/** All controls of visitors at once, of a generator in a child too: axe in light, dark and forced colors, the keyboard alone, and visitors who ask for less motion. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { emulateMedia, sendKeys } from '@web/test-runner-commands';
import { violationsIn } from '../../element/browser/support/axe.js';
import { assert, assertEqual, COMPASS, nextEvent, showLoaded, until } from '../../element/browser/support/harness.js';
import { sendTouch } from '../../element/browser/support/screen.js';
import { FIXTURES } from './support.js';

GaussianSplatElement.runtimeLocation = '/node_modules/onnxruntime-web/dist/';

const VIEWS = '[{ "name": "Front", "orbit": "0deg 75deg 100%" }, { "name": "Right", "orbit": "90deg 75deg 100%" }]';
const PARTS = ['reset-button', 'pause-button', 'previous-view', 'next-view', 'controls-panel', 'controls-group'];
const partOf = (element: Element, name: string): HTMLElement | null =>
  element.shadowRoot!.querySelector<HTMLElement>(`[part~=${name}]`);

/** One that has all of them: a panel, a bar of views, a button that pauses, and one that brings the camera back once a finger has moved it. */
async function showAll(): Promise<{ element: GaussianSplatElement; child: SplatSceneElement }> {
  document.body.style.margin = '0';
  const element = await showLoaded(
    {
      ...{ src: COMPASS, alt: 'A compass and a ball', views: VIEWS, 'camera-controls': '', 'controls-panel': '' },
      ...{ 'interaction-prompt': 'none', 'interpolation-decay': '0', 'touch-action': 'none' },
    },
    'display: block; width: 500px; height: 400px',
  );
  const child = document.createElement('splat-scene') as SplatSceneElement;
  Object.assign(child, { title: 'Ball' });
  for (const [name, value] of Object.entries({ src: `${FIXTURES}state.onnx`, autoplay: '', loop: '' }))
    child.setAttribute(name, value);
  const reported = nextEvent(child, 'inputs-change');
  element.append(child);
  await reported;
  await child.ready;
  await sendTouch('touchStart', [{ x: 100, y: 300 }]);
  for (const x of [80, 60]) await sendTouch('touchMove', [{ x, y: 300 }]);
  await sendTouch('touchEnd', []);
  for (const name of PARTS) await until(() => partOf(element, name) !== null, name);
  return { element, child };
}

afterEach(async () => {
  document.documentElement.style.colorScheme = '';
  await emulateMedia({ colorScheme: 'light', forcedColors: 'none', reducedMotion: 'no-preference' });
});

it('axe finds nothing in them in light, dark and forced colors; the keyboard reaches each, and is in the scene again after the button that goes', async () => {
  const { element, child } = await showAll();
  document.documentElement.style.colorScheme = 'light dark';
  const looks = [
    { colorScheme: 'light', forcedColors: 'none' },
    { colorScheme: 'dark', forcedColors: 'none' },
    { colorScheme: 'light', forcedColors: 'active' },
    { colorScheme: 'dark', forcedColors: 'active' },
  ] as const;
  for (const look of looks) {
    await emulateMedia(look);
    assertEqual(await violationsIn(element), [], JSON.stringify(look));
  }
  for (const name of PARTS.slice(0, 4)) {
    const { width, height } = partOf(element, name)!.getBoundingClientRect();
    assert(width >= 24 && height >= 24, `${name} is ${width} x ${height}`);
  }

  element.focus();
  const reached: string[] = [];
  let slider: HTMLInputElement | null = null;
  for (let i = 0; i < 20 && document.activeElement === element; i++) {
    const { part, localName } = element.shadowRoot!.activeElement as HTMLElement;
    reached.push(part.value || localName);
    if ((element.shadowRoot!.activeElement as HTMLInputElement).type === 'range') {
      slider = element.shadowRoot!.activeElement as HTMLInputElement;
      const before = slider.value;
      await sendKeys({ press: 'ArrowRight' });
      assert(slider.value !== before, 'the arrow moves the slider');
    }
    await sendKeys({ press: 'Tab' });
  }
  for (const name of ['reset-button', 'pause-button', 'previous-view', 'next-view', 'summary', 'control-input'])
    assert(reached.includes(name), `${name} is not among ${reached.join()}`);
  assert(slider !== null && child.inputValues !== null, 'what the slider says is set');
  partOf(element, 'reset-button')!.focus();
  await sendKeys({ press: 'Enter' });
  await until(() => partOf(element, 'reset-button') === null, 'the button to go');
  assertEqual(element.shadowRoot!.activeElement?.id, 'view', 'where the keyboard is');
});

it('visitors who ask for less motion: a child does not play automatically, views and the way back jump', async () => {
  await emulateMedia({ reducedMotion: 'reduce' });
  const { element, child } = await showAll();
  assertEqual(child.paused, true, 'the child stands still');
  element.interpolationDecay = 1000;
  await element.updateComplete;
  const theta = (): number => (element.getCameraOrbit().theta * 180) / Math.PI;
  partOf(element, 'next-view')!.click();
  await until(() => Math.abs(theta()) < 1e-6, 'the first view');
  partOf(element, 'next-view')!.click();
  await until(() => Math.abs(theta() - 90) < 1e-6, 'the second view');
  const seen: number[] = [];
  element.addEventListener('camera-change', () => seen.push(theta()));
  partOf(element, 'previous-view')!.click();
  await until(() => Math.abs(theta()) < 1e-6, 'the first view again');
  assert(
    seen.every((at) => Math.abs(at) < 1e-6),
    `on the way: ${seen.join()}`,
  );
});
