/** Elements in other documents than the page's: frames, and those that are gone. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, COMPASS, delay, showLoaded, submits, hurry, until } from './support/harness.js';

const canvasOf = (element: GaussianSplatElement): HTMLCanvasElement => {
  const canvas = element.shadowRoot?.querySelector('canvas');
  assert(canvas, 'a canvas');
  return canvas;
};
const canvasSize = (element: GaussianSplatElement): [number, number] => [
  canvasOf(element).width,
  canvasOf(element).height,
];

beforeEach(() => hurry(3));

describe('another document', () => {
  it('an element that is moved into an iframe keeps its styles and its frame', async () => {
    const element = await showLoaded();
    const frame = document.createElement('iframe');
    document.body.append(frame);
    const inside = frame.contentDocument!;
    inside.body.append(element);
    await delay(300);
    const style = frame.contentWindow!.getComputedStyle(element);
    assertEqual([style.position, style.contain], ['relative', 'strict']);
    assert(element.loaded, 'the scene is still there');
    assertEqual(canvasSize(element), [120, 100]);
  });

  it('an element that is made here and first shown in an iframe has its styles and its frame', async () => {
    const frame = document.createElement('iframe');
    document.body.append(frame);
    const element = document.createElement('gaussian-splat');
    element.loading = 'eager';
    element.src = COMPASS;
    element.style.cssText = 'width: 120px; height: 100px';
    frame.contentDocument!.body.append(element);
    await element.ready;
    assert(element.loaded, element.error?.message ?? 'no scene');
    assertEqual(frame.contentWindow!.getComputedStyle(element).position, 'relative');
    assertEqual(canvasSize(element), [120, 100]);
    frame.remove();
  });

  it('an element whose iframe was removed draws nothing, and shows its frame in its next place', async () => {
    const element = await showLoaded({ 'auto-rotate': '', 'auto-rotate-delay': '0' });
    const frame = document.createElement('iframe');
    document.body.append(frame);
    frame.contentDocument!.body.append(element);
    await delay(300);
    const first = canvasOf(element);
    frame.remove();
    await delay(100);
    const before = submits;
    await delay(300);
    assertEqual(submits - before, 0, 'submits without a window');
    document.body.append(element);
    await delay(300);
    assert(canvasOf(element) !== first, 'another canvas');
    assert(submits > before, 'it draws again');
  });

  it('frames come from the window that contains an element, which may be visible while the page is not', async () => {
    const element = await showLoaded({ 'auto-rotate': '', 'auto-rotate-delay': '0' });
    const frame = document.createElement('iframe');
    document.body.append(frame);
    const inside = frame.contentWindow as Window & typeof globalThis;
    const asked = inside.requestAnimationFrame;
    let own = 0;
    inside.requestAnimationFrame = (callback) => {
      own++;
      return asked.call(inside, callback);
    };
    frame.contentDocument!.body.append(element);
    const here = requestAnimationFrame;
    let others = 0;
    window.requestAnimationFrame = (callback) => {
      others++;
      return here.call(window, callback);
    };
    try {
      await until(() => own > 3, 'frames of its own window');
    } finally {
      window.requestAnimationFrame = here;
    }
    assertEqual(others, 0, 'frames of the page');
    frame.remove();
  });
});
