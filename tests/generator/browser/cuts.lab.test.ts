/** Cuts of a scene that a generator makes: they act on every frame, and picking respects them. */
import { insideOf } from '../../element/browser/support/inside.js';
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, nextEvent, showLoaded, until } from '../../element/browser/support/harness.js';
import { comesToShow, screenOf, type Rgb, type Screen } from '../../element/browser/support/screen.js';
import { FIXTURES } from './support.js';

GaussianSplatElement.runtimeLocation = '/net/compressed/onnxruntime-web/dist/';

const VIEW = { 'camera-orbit': '0deg 90deg 6m', 'camera-target': '0 0 0', quality: 'default' };
const WIDTH = 120;
/** Splats across the edge of a cut are trimmed to splats: this fraction of a half's pixels stays covered. */
const EDGE = 0.2;
/** Pixels beside the edge that are not picked. */
const MARGIN = 8;
const isCovered = ([red, green, blue]: Rgb): boolean => red + green + blue < 700;
const isBlack = ([red, green, blue]: Rgb): boolean => Math.max(red, green, blue) < 60;

// The line with the author of the model lies on the scene, and is dark.
before(() => {
  const style = document.createElement('style');
  style.textContent = 'gaussian-splat::part(credits) { display: none }';
  document.head.append(style);
});

/** Pixels of the splats on each half of the screen. */
function halves(screen: Screen, isPicked = isCovered): [left: number, right: number] {
  const counts: [number, number] = [0, 0];
  for (let y = 0.5; y < 100; y++)
    for (let x = 0.5; x < WIDTH; x++) if (isPicked(screen.at(x, y))) counts[x < WIDTH / 2 ? 0 : 1]++;
  return counts;
}

/** Whether a place of the left or right half is picked: the splats are sparse, so all darker ones are tried. */
async function isPicked(element: GaussianSplatElement, screen: Screen, side: 0 | 1): Promise<boolean> {
  const { left, top } = element.getBoundingClientRect();
  for (let y = 26.5; y < 74; y += 4)
    for (let x = 26.5; x < 94; x += 4) {
      const isOnSide = (x < WIDTH / 2 ? 0 : 1) === side;
      if (!isOnSide || Math.abs(x - WIDTH / 2) < MARGIN || !isCovered(screen.at(x, y))) continue;
      if ((await element.positionFromPoint(left + x, top + y)) !== null) return true;
    }
  return false;
}

/** Adds a cut, and waits until the code and pipelines of cuts are loaded. */
async function cut(parent: Element, attributes: Readonly<Record<string, string>>): Promise<HTMLElement> {
  const child = document.createElement('splat-cut');
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
  parent.append(child);
  const { sources } = insideOf(parent.closest('gaussian-splat')!);
  await until(() => sources.world.placements.some(({ modifier }) => modifier), 'the cut acts');
  return child;
}

it('a cut hides part of a generated scene, also in its later frames, and picking finds the rest', async () => {
  const element = await showLoaded({ src: `${FIXTURES}packed.onnx`, ...VIEW });
  const whole = await screenOf(element);
  const [left, right] = halves(whole);
  assert(left > 100 && right > 100, `${left} and ${right} pixels`);
  assert((await isPicked(element, whole, 0)) && (await isPicked(element, whole, 1)), 'both halves are picked');
  const child = await cut(element, { shape: 'box', scale: '100', position: '50 0 0', edge: 'hard' });
  assert(await comesToShow(element, (screen) => halves(screen)[1] < EDGE * right), 'the right half is hidden');
  assert(halves(await screenOf(element))[0] > 0.9 * left, 'the left half stays');
  assertEqual(await isPicked(element, whole, 1), false, 'the right half is picked');
  assert(await isPicked(element, whole, 0), 'the left half is picked');
  const seeked = nextEvent(element, 'seeked');
  element.setAttribute('time', '1.5707');
  await seeked;
  assert(
    await comesToShow(element, (screen) => halves(screen)[0] > 1.05 * left && halves(screen)[1] < EDGE * right),
    'the next frame of the generator is cut, too',
  );
  child.remove();
  assert(await comesToShow(element, (screen) => halves(screen)[1] > 0.9 * right), 'the right half is back');
});

it('a cut tints a generated scene, and that of a <splat-scene> leaves the other one alone', async () => {
  const element = await showLoaded({ src: `${FIXTURES}packed.onnx`, ...VIEW });
  const scene = document.createElement('splat-scene');
  scene.setAttribute('src', `${FIXTURES}split.onnx`);
  scene.setAttribute('position', '2.5 0 0');
  element.append(scene);
  await until(() => (scene as HTMLElement & { loaded?: boolean }).loaded === true, 'the child');
  await cut(scene, { shape: 'sphere', scale: '100', effect: 'tint', color: 'black' });
  const isTinted = (screen: Screen): boolean => halves(screen, isBlack)[1] > 50 && halves(screen, isBlack)[0] === 0;
  assert(await comesToShow(element, isTinted), 'the child is black, the other scene is not');
  await cut(element, { shape: 'sphere', scale: '100', effect: 'tint', color: 'black' });
  assert(await comesToShow(element, (screen) => halves(screen, isBlack)[0] > 50), 'both are black');
});
