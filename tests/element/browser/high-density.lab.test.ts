/** Runs in a browser whose screen has two device pixels for each CSS pixel: see web-test-runner.config.mjs. */
import '@gaussian-splat/element';
import { assertEqual, showLoaded, until } from './support/harness.js';

const canvasOf = (element: Element): HTMLCanvasElement | null | undefined =>
  element.shadowRoot?.querySelector('canvas');

describe('on a dense screen', () => {
  before(async () => {
    // A freshly opened page may report its ratio with a delay.
    await until(() => devicePixelRatio === 2 && matchMedia('(resolution: 2dppx)').matches, 'the ratio of this screen');
  });

  it('every device pixel is drawn, up to max-pixel-ratio', async () => {
    const element = await showLoaded();
    assertEqual([canvasOf(element)?.width, canvasOf(element)?.height], [240, 200], 'canvas');
    element.maxPixelRatio = 1.5;
    await until(() => canvasOf(element)?.width === 180, 'one and a half pixels for each');
    assertEqual(canvasOf(element)?.height, 150, 'height');
    element.maxPixelRatio = 8;
    await until(() => canvasOf(element)?.width === 240, 'no more than there are');
  });

  it('also in a browser that does not report device pixels, and when the ratio changes there', async () => {
    const observe = ResizeObserver.prototype.observe;
    const matchMediaBefore = window.matchMedia;
    const queries: MediaQueryList[] = [];
    ResizeObserver.prototype.observe = function observeAsSafari(target, options) {
      if (options?.box === 'device-pixel-content-box') throw new TypeError('unknown box');
      observe.call(this, target, options);
    };
    window.matchMedia = (query) => {
      const list = matchMediaBefore.call(window, query);
      if (query.includes('resolution')) queries.push(list);
      return list;
    };
    try {
      const element = await showLoaded();
      // An emulated screen may report its ratio more than once; the last watch is the one in force.
      await until(() => canvasOf(element)?.width === 240 && queries.at(-1)?.matches === true, 'the watched ratio');
      const before = queries.length;
      Object.defineProperty(window, 'devicePixelRatio', { configurable: true, get: () => 3 });
      queries.at(-1)?.dispatchEvent(new Event('change'));
      await until(() => canvasOf(element)?.width === 360, 'three times the pixels');
      assertEqual(queries.length, before + 1, 'watches: one more, for the next change');
    } finally {
      Reflect.deleteProperty(window, 'devicePixelRatio');
      ResizeObserver.prototype.observe = observe;
      window.matchMedia = matchMediaBefore;
    }
  });
});
